#include "test/backend/drifted_circle.h"

#include <algorithm>
#include <utility>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

FilledMap circle_map(int keyframes) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kOrbit;
  options.times = keyframes;
  options.landmarks = 1500;
  options.noise = 0;
  return fill_map(make_synthetic_scene(options), {});
}

MapTruth truth_of(const MapSnapshot& map) {
  MapTruth truth;
  for (const KeyframeId id : map.keyframe_ids()) {
    truth.cam_from_world.push_back(map.at(id).cam_from_world);
  }
  for (const LandmarkId id : map.landmark_ids()) truth.points.push_back(map.at(id).point_in_world);
  return truth;
}

void let_drift(Map& moved, const MapTruth& truth, const Vector6d& drift, double growth) {
  const MapSnapshot& map = moved.view();
  std::vector<std::pair<KeyframeId, Rigid3d>> poses;
  std::vector<Sim3d> drifted_from_true{Sim3d()};  // of the world, at each keyframe
  Rigid3d estimate = truth.cam_from_world[0];
  double scale = 1;
  for (std::size_t i = 1; i < truth.cam_from_world.size(); ++i) {
    Rigid3d step = truth.cam_from_world[i] * inverse(truth.cam_from_world[i - 1]);
    scale *= growth;
    step.translation() *= scale;
    estimate = se3_exp(drift) * step * estimate;
    poses.emplace_back(map.keyframe_ids()[i], estimate);
    const Sim3d scaling(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), scale);
    drifted_from_true.push_back(inverse(Sim3d(estimate)) * scaling *
                                Sim3d(truth.cam_from_world[i]));
  }
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
  for (const LandmarkId id : map.landmark_ids()) {
    const Landmark& landmark = map.at(id);
    points.emplace_back(id, drifted_from_true[landmark.reference.value] * landmark.point_in_world);
  }
  moved.move(poses, points);
}

double worst_position_error(const MapSnapshot& map, const MapTruth& truth) {
  double worst = 0;
  for (const KeyframeId id : map.keyframe_ids()) {
    worst = std::max(worst, (origin_in_a(map.at(id).cam_from_world) -
                             origin_in_a(truth.cam_from_world[id.value]))
                                .norm());
  }
  return worst;
}

double worst_point_error(const MapSnapshot& map, const MapTruth& truth) {
  double worst = 0;
  const std::vector<LandmarkId> ids = map.landmark_ids();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    worst = std::max(worst, (map.at(ids[i]).point_in_world - truth.points[i]).norm());
  }
  return worst;
}

PoseConstraint measured(const MapTruth& truth, std::uint32_t a, std::uint32_t b) {
  PoseConstraint loop;
  loop.a = KeyframeId(a);
  loop.b = KeyframeId(b);
  loop.a_from_b = Sim3d(truth.cam_from_world[a] * inverse(truth.cam_from_world[b]));
  return loop;
}

LoopGraphOptions chain_options() {
  LoopGraphOptions options;
  options.min_shared_landmarks = 1 << 20;
  return options;
}

Vector6d small_drift() {
  Vector6d drift;
  drift << 0.01, -0.008, 0.012, 0.004, 0.003, -0.005;
  return drift;
}

}  // namespace hybrid_slam
