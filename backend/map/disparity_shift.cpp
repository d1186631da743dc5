#include "backend/map/disparity_shift.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "backend/map/map_file_format.h"

namespace hybrid_slam {
namespace {

constexpr double kLeast = 0.1;  // [px] disparities that are left

// New depth over old one of a point in its reference keyframe; 1 where a disparity says nothing of
// it.
double depth_ratio(const MapSnapshot& map, const Landmark& landmark, CameraId camera, double by) {
  const Keyframe& reference = map.at(landmark.reference);
  if (reference.observations->camera != camera) return 1;
  const auto& stereo = std::get<Calibrated<RectifiedStereo>>(map.camera(camera));
  const double depth = (reference.cam_from_world * landmark.point_in_world).z();
  if (!(depth > 0)) return 1;
  const double disparity = stereo.params[0] * stereo.params[4] / depth;
  return disparity / std::max(disparity + by, kLeast);
}

double median(std::vector<double> values) {
  if (values.empty()) return 1;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Rigid3d scaled(const Rigid3d& transform, double scale) {
  return {transform.rotation(), scale * transform.translation()};
}

std::shared_ptr<const FrameObservations> shifted(const FrameObservations& seen, double by) {
  auto result = std::make_shared<FrameObservations>(seen);
  if (result->disparity_offset) *result->disparity_offset += by;
  for (std::size_t i = 0; i < result->u_right.size(); ++i) {
    float& u_right = result->u_right[i];
    u_right -= static_cast<float>(by);
    if (std::isnan(u_right)) continue;
    u_right = std::min(u_right, result->features.keypoints[i].x - static_cast<float>(kLeast));
  }
  return result;
}

std::shared_ptr<const Odometry> scaled(const std::shared_ptr<const Odometry>& odometry,
                                       double scale) {
  if (odometry == nullptr) return nullptr;
  auto result = std::make_shared<Odometry>(*odometry);
  result->motion.b_from_a = scaled(result->motion.b_from_a, scale);
  return result;
}

}  // namespace

double shift_disparities(Map& map, CameraId camera, double by, KeyframeId first) {
  const MapSnapshot& view = map.view();
  if (view.newest_keyframe(camera) == nullptr || by == 0) return 1;
  std::vector<double> ratios;
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
  std::vector<std::pair<KeyframeId, Rigid3d>> poses;
  for (const LandmarkId id : view.landmark_ids()) {
    const Landmark& landmark = view.at(id);
    ratios.push_back(landmark.reference < first ? 1 : depth_ratio(view, landmark, camera, by));
  }
  const double scale = first == KeyframeId(0) ? median(ratios) : 1;
  std::size_t next = 0;
  for (const LandmarkId id : view.landmark_ids()) {
    const Landmark& landmark = view.at(id);
    const Rigid3d& reference = view.at(landmark.reference).cam_from_world;
    const double ratio = ratios[next++];
    points.emplace_back(id, inverse(scaled(reference, scale)) *
                                Eigen::Vector3d(ratio * (reference * landmark.point_in_world)));
  }
  for (const KeyframeId id : view.keyframe_ids()) {
    poses.emplace_back(id, scaled(view.at(id).cam_from_world, scale));
  }
  MapTables& tables = MapFileAccess::tables(map);
  for (const KeyframeId id : view.keyframe_ids()) {
    Keyframe& keyframe = tables.keyframes.edit(id.value);
    keyframe.odometry = scaled(keyframe.odometry, scale);
    if (keyframe.observations->camera != camera || id < first) continue;
    keyframe.observations = shifted(*keyframe.observations, by);
  }
  for (std::uint32_t id = 0; id < tables.next_keyframe; ++id) {
    if (tables.erased.find(id) == nullptr) continue;
    ErasedKeyframe& erased = tables.erased.edit(id);
    erased.cam_from_parent = scaled(erased.cam_from_parent, scale);
  }
  map.set_covariances(nullptr);
  map.move(poses, points);
  return scale;
}

}  // namespace hybrid_slam
