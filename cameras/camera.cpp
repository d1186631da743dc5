#include "cameras/camera.h"

#include <cmath>
#include <type_traits>

namespace hybrid_slam {

std::optional<Eigen::Vector2d> project(const Camera& camera, const Eigen::Vector3d& point_in_cam) {
  return std::visit(
      [&]<typename M>(const Calibrated<M>& c) -> std::optional<Eigen::Vector2d> {
        double measurement[M::kMeasurementDim];
        if (!M::project(c.params.data(), point_in_cam.data(), measurement)) return std::nullopt;
        return Eigen::Vector2d(measurement[0], measurement[1]);
      },
      camera);
}

std::optional<Eigen::Vector3d> project_stereo(const Camera& camera,
                                              const Eigen::Vector3d& point_in_cam) {
  const auto* stereo = std::get_if<Calibrated<RectifiedStereo>>(&camera);
  if (stereo == nullptr) return std::nullopt;
  Eigen::Vector3d measurement;
  if (!RectifiedStereo::project(stereo->params.data(), point_in_cam.data(), measurement.data())) {
    return std::nullopt;
  }
  return measurement;
}

std::optional<Eigen::Vector3d> unproject(const Camera& camera, const Eigen::Vector2d& pixel) {
  return std::visit(
      [&]<typename M>(const Calibrated<M>& c) -> std::optional<Eigen::Vector3d> {
        Eigen::Vector3d bearing;
        if (!M::unproject(c.params.data(), pixel.data(), bearing.data())) return std::nullopt;
        return bearing;
      },
      camera);
}

std::optional<Eigen::Vector3d> triangulate_stereo(const Camera& camera,
                                                  const Eigen::Vector3d& measurement) {
  const auto* stereo = std::get_if<Calibrated<RectifiedStereo>>(&camera);
  if (stereo == nullptr) return std::nullopt;
  const auto& [fx, fy, cx, cy, base] = stereo->params;
  const double disparity = measurement[0] - measurement[2];
  if (!(disparity > 0) || !(base > 0)) return std::nullopt;
  const double z = fx * base / disparity;
  return Eigen::Vector3d(z * (measurement[0] - cx) / fx, z * (measurement[1] - cy) / fy, z);
}

bool in_image(const Camera& camera, const Eigen::Vector2d& pixel) {
  return pixel[0] >= -0.5 && pixel[1] >= -0.5 && pixel[0] < image_width(camera) - 0.5 &&
         pixel[1] < image_height(camera) - 0.5;
}

double focal_length(const Camera& camera) {
  return std::visit(
      []<typename M>(const Calibrated<M>& c) { return M::focal_length(c.params.data()); }, camera);
}

double baseline(const Camera& camera) {
  const auto* stereo = std::get_if<Calibrated<RectifiedStereo>>(&camera);
  return stereo == nullptr ? 0 : stereo->params[4];
}

int image_width(const Camera& camera) {
  return std::visit([](const auto& c) { return c.width; }, camera);
}

int image_height(const Camera& camera) {
  return std::visit([](const auto& c) { return c.height; }, camera);
}

std::string_view model_name(const Camera& camera) {
  return std::visit([]<typename M>(const Calibrated<M>&) { return M::kName; }, camera);
}

}  // namespace hybrid_slam
