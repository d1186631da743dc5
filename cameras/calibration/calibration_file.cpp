#include "cameras/calibration/calibration_file.h"

#include <array>
#include <cmath>

#include "cameras/calibration/calibration_section.h"

namespace hybrid_slam {
namespace {

struct RectifiedCamera {
  int width;
  int height;
  std::vector<double> p;  // 3x4
};

RectifiedCamera read_ros_camera(const YamlSection& file) {
  RectifiedCamera camera;
  const bool is_message = !file.has("image_width") && file.has("width");  // a CameraInfo
  const std::string prefix = is_message ? "" : "image_";
  camera.width = image_size(file, prefix + "width", file.number(prefix + "width"));
  camera.height = image_size(file, prefix + "height", file.number(prefix + "height"));
  const std::string key = !is_message ? "projection_matrix" : file.has("P") ? "P" : "p";
  camera.p = is_message ? file.numbers(key, 12) : file.matrix(key, 3, 4);
  const std::vector<double>& p = camera.p;
  if (p[1] != 0 || p[4] != 0 || p[8] != 0 || p[9] != 0 || p[10] != 1 || p[11] != 0) {
    file.fail(key, "is no rectified camera's");
  }
  const double intrinsics[4] = {p[0], p[5], p[2], p[6]};
  check_intrinsics(file, intrinsics, camera.width, camera.height, key);
  return camera;
}

}  // namespace

Calibrated<RectifiedStereo> read_ros_stereo(const std::string& left_path,
                                            const std::string& right_path) {
  const YamlSection left_file = YamlSection::read(left_path);
  const YamlSection right_file = YamlSection::read(right_path);
  const RectifiedCamera left = read_ros_camera(left_file);
  const RectifiedCamera right = read_ros_camera(right_file);
  if (left.width != right.width || left.height != right.height) {
    right_file.fail("image_width", "the size differs from that of " + left_path);
  }
  constexpr double kTolerance = 1e-3;  // [px]
  for (const std::size_t i : std::array<std::size_t, 4>{0, 2, 5, 6}) {
    if (std::abs(left.p[i] - right.p[i]) > kTolerance) {
      right_file.fail("projection_matrix", "the pair is not rectified: entry " + std::to_string(i) +
                                               " differs from that of " + left_path);
    }
  }
  if (left.p[7] != 0 || right.p[7] != 0) {
    right_file.fail("projection_matrix", "a vertical baseline is not supported");
  }
  if (left.p[3] != 0) {
    left_file.fail("projection_matrix", left.p[3] < 0 && right.p[3] == 0
                                            ? "left and right files are swapped"
                                            : "P[3] of the left camera must be 0");
  }
  if (right.p[3] == 0) right_file.fail("projection_matrix", "P[3] is 0: there is no baseline");
  if (right.p[3] > 0) {
    right_file.fail("projection_matrix",
                    "P[3] is positive: the baseline has the wrong sign (left and right swapped?)");
  }
  return {{left.p[0], left.p[5], left.p[2], left.p[6], -right.p[3] / right.p[0]},
          left.width,
          left.height};
}

}  // namespace hybrid_slam
