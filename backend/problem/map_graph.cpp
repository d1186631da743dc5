#include "backend/problem/map_graph.h"

#include <limits>

namespace hybrid_slam {

namespace {

// All params vary but a stereo pair's baseline, which holds the scale.
std::uint32_t refined_params(const Camera& camera) {
  const std::size_t count = std::visit([](const auto& c) { return c.params.size(); }, camera);
  std::uint32_t mask = (1U << count) - 1;
  if (std::holds_alternative<Calibrated<RectifiedStereo>>(camera)) mask &= ~(1U << 4);
  return mask;
}

class Assembler {
 public:
  Assembler(const MapSnapshot& map, const ProblemConfig& config) : map_(map), config_(config) {}

  MapGraph assemble() {
    add_cameras();
    for (const KeyframeId id : config_.variable_poses) add_pose(id, false);
    for (const KeyframeId id : config_.fixed_poses) add_pose(id, true);
    for (const LandmarkId id : config_.variable_landmarks) add_landmark(id, false);
    for (const LandmarkId id : config_.fixed_landmarks) add_landmark(id, true);
    for (const PoseConstraint& constraint : config_.constraints) add_constraint(constraint);
    return std::move(made_);
  }

 private:
  static constexpr std::uint32_t kAbsent = std::numeric_limits<std::uint32_t>::max();

  void add_cameras() {
    for (std::uint32_t i = 0; i < map_.camera_count(); ++i) {
      made_.graph.cameras.push_back({map_.camera(CameraId(i)), 0});
    }
    for (const CameraId id : config_.refined_cameras) {
      GraphCamera& camera = made_.graph.cameras.at(id.value);
      camera.refined = refined_params(camera.camera);
    }
  }

  void add_pose(KeyframeId id, bool fixed) {
    const Keyframe* keyframe = map_.find(id);
    if (keyframe == nullptr) return;
    if (index_of_.size() <= id.value) index_of_.resize(id.value + 1, kAbsent);
    index_of_[id.value] = static_cast<std::uint32_t>(made_.frames.size());
    made_.frames.push_back(id);
    keyframes_.push_back(keyframe);
    if (config_.with_scale) {
      made_.graph.similarities.push_back({Sim3d(keyframe->cam_from_world), fixed});
    } else {
      made_.graph.frames.push_back(
          {keyframe->cam_from_world, keyframe->observations->camera.value, fixed});
    }
  }

  std::uint32_t index_of(KeyframeId id) const {
    return id.value < index_of_.size() ? index_of_[id.value] : kAbsent;
  }

  void add_landmark(LandmarkId id, bool fixed) {
    const Landmark* landmark = map_.find(id);
    if (landmark == nullptr || config_.with_scale) return;
    const auto point = static_cast<std::uint32_t>(made_.points.size());
    made_.points.push_back(id);
    made_.graph.points.push_back({landmark->point_in_world, fixed});
    for (const Observation& observation : landmark->observations) {
      const std::uint32_t frame = index_of(observation.keyframe);
      if (frame == kAbsent || (fixed && made_.graph.frames[frame].fixed)) continue;
      add_observation(id, observation, frame, point);
    }
  }

  void add_observation(LandmarkId id, const Observation& observation, std::uint32_t frame,
                       std::uint32_t point) {
    const FrameObservations& seen = *keyframes_[frame]->observations;
    const Keypoint& keypoint = seen.features.keypoints[observation.keypoint];
    const double u_right =
        seen.has_right(observation.keypoint) ? seen.u_right[observation.keypoint] : kNoRightMatch;
    made_.graph.observations.push_back(
        {frame, point, {keypoint.x, keypoint.y, u_right}, keypoint.sigma});
    made_.observations.push_back({id, observation});
  }

  void add_constraint(const PoseConstraint& constraint) {
    const std::uint32_t a = index_of(constraint.a);
    const std::uint32_t b = index_of(constraint.b);
    if (a == kAbsent || b == kAbsent) return;
    if (config_.with_scale) {
      made_.graph.similarity_edges.push_back(
          {a, b, constraint.a_from_b, constraint.information, constraint.loop});
    } else {
      made_.graph.edges.push_back({a, b, without_scale(constraint.a_from_b),
                                   constraint.information.topLeftCorner<6, 6>(), constraint.loop});
    }
  }

  const MapSnapshot& map_;
  const ProblemConfig& config_;
  MapGraph made_;
  std::vector<const Keyframe*> keyframes_;  // as made_.frames
  std::vector<std::uint32_t> index_of_;     // into made_.frames, by the keyframe's id
};

}  // namespace

MapGraph make_graph(const MapSnapshot& map, const ProblemConfig& config) {
  return Assembler(map, config).assemble();
}

}  // namespace hybrid_slam
