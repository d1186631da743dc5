#include "frontend/input/fisheye_calibration.h"

#include <numbers>

#include "cameras/calibration/calibration_file.h"

namespace hybrid_slam {

Calibrated<KannalaBrandt> read_fisheye_of_images(const std::filesystem::path& path, ImageSize image,
                                                 std::vector<std::string>& warnings) {
  return fisheye_of_images(read_fisheye(path.string(), &warnings), image, path.string());
}

Calibrated<KannalaBrandt> fisheye_of_images(Calibrated<KannalaBrandt> camera, ImageSize image,
                                            const std::string& source) {
  if (camera.width == 0) {
    camera.width = image.width;
    camera.height = image.height;
  }
  check_image_size(image, {camera.width, camera.height}, source);
  constexpr double kMinAngle = 60;  // [deg] to the axis
  const double max_angle = KannalaBrandt::max_angle(camera.params.data()) * 180 / std::numbers::pi;
  if (!(max_angle >= kMinAngle)) {
    throw InputError(source + ": k1 to k4: the field of view folds at " +
                     std::to_string(static_cast<int>(max_angle)) + " degrees from the axis");
  }
  return camera;
}

}  // namespace hybrid_slam
