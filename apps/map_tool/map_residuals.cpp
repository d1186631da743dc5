#include "apps/map_tool/map_residuals.h"

#include <algorithm>
#include <cmath>

namespace hybrid_slam {

std::optional<ViewResidual> residual_of(const MapSnapshot& map, const Keyframe& keyframe,
                                        std::uint32_t keypoint) {
  const FrameObservations& frame = *keyframe.observations;
  const Camera& camera = map.camera(keyframe);
  const Eigen::Vector3d point =
      keyframe.cam_from_world * map.at(keyframe.landmarks[keypoint]).point_in_world;
  const Keypoint& seen = frame.features.keypoints[keypoint];
  ViewResidual residual;
  residual.sigma = seen.sigma;
  if (frame.has_right(keypoint)) {
    const auto at = project_stereo(camera, point);
    if (!at) return std::nullopt;
    residual.pixels = Eigen::Vector3d(seen.x, seen.y, frame.u_right[keypoint]) - *at;
    residual.dimension = 3;
  } else {
    const auto at = project(camera, point);
    if (!at) return std::nullopt;
    residual.pixels.head<2>() = Eigen::Vector2d(seen.x, seen.y) - *at;
  }
  return residual;
}

std::vector<ResidualSummary> residuals_by_camera(const MapSnapshot& map) {
  std::vector<ResidualSummary> cameras(map.camera_count());
  std::vector<std::vector<double>> whitened(map.camera_count());
  std::vector<double> squares(map.camera_count());  // [px^2]
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    const std::size_t camera = keyframe.observations->camera.value;
    for (std::uint32_t k = 0; k < keyframe.landmarks.size(); ++k) {
      if (!keyframe.landmarks[k].valid()) continue;
      const auto residual = residual_of(map, keyframe, k);
      ++(residual ? cameras[camera].observations : cameras[camera].behind);
      if (!residual) continue;
      squares[camera] += residual->pixels.squaredNorm();
      for (int i = 0; i < residual->dimension; ++i) {
        whitened[camera].push_back(std::abs(residual->pixels[i]) / residual->sigma);
      }
    }
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    std::vector<double>& all = whitened[i];
    if (all.empty()) continue;
    const auto count = static_cast<double>(all.size());
    double sum = 0;
    for (const double value : all) sum += value * value;
    cameras[i].rms_pixels = std::sqrt(squares[i] / count);
    cameras[i].rms = std::sqrt(sum / count);
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    cameras[i].median = *middle;
  }
  return cameras;
}

}  // namespace hybrid_slam
