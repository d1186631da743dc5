#include "backend/problem/loop_graph.h"

#include <algorithm>
#include <set>

#include "backend/map/odometry.h"

namespace hybrid_slam {

namespace {

bool is_metric(const MapSnapshot& map, KeyframeId id) {
  return baseline(map.camera(map.at(id))) > 0;
}

// Of a motion between two components: it keeps them from falling apart and holds nothing.
Matrix7d loose_information() {
  const UncertainMotion unknown = unknown_motion(Rigid3d());
  Matrix7d information = Matrix7d::Identity();
  information.topLeftCorner<6, 6>() = unknown.covariance.diagonal().cwiseInverse().asDiagonal();
  return information;
}

// Motions that the map remembers, each pair once.
class Remembered {
 public:
  Remembered(const MapSnapshot& map, const LoopGraphOptions& options,
             std::vector<PoseConstraint>& constraints)
      : map_(map), options_(options), constraints_(constraints) {}

  void add(KeyframeId a, KeyframeId b) {
    if (map_.find(a) == nullptr || map_.find(b) == nullptr) return;
    if (!pairs_.insert(std::minmax(a, b)).second) return;
    const Sim3d a_from_b(map_.at(a).cam_from_world * inverse(map_.at(b).cam_from_world));
    const bool joined = map_.at(a).component == map_.at(b).component;
    constraints_.push_back(
        {a, b, a_from_b,
         joined ? motion_information(map_, a, b, a_from_b, options_) : loose_information(), false});
  }

 private:
  const MapSnapshot& map_;
  const LoopGraphOptions& options_;
  std::vector<PoseConstraint>& constraints_;
  std::set<std::pair<KeyframeId, KeyframeId>> pairs_;
};

// What is older than the loops and than all that edges join to what is newer bends with none of
// them: it hangs on the rest at one place, and a motion of all the rest costs nothing. It is fixed.
void hold_what_stays(ProblemConfig& config) {
  KeyframeId oldest;  // end of a loop
  for (const PoseConstraint& one : config.constraints) {
    if (!one.loop) continue;
    const KeyframeId end = std::min(one.a, one.b);
    oldest = oldest.valid() ? std::min(oldest, end) : end;
  }
  if (!oldest.valid()) return;
  KeyframeId first = oldest;  // that may bend
  for (const PoseConstraint& one : config.constraints) {
    const auto [older, newer] = std::minmax(one.a, one.b);
    if (newer >= oldest) first = std::min(first, older);
  }
  const auto begin = config.variable_poses.begin();
  const auto end = std::lower_bound(begin, config.variable_poses.end(), first);
  config.fixed_poses.insert(config.fixed_poses.end(), begin, end);
  config.variable_poses.erase(begin, end);
  std::sort(config.fixed_poses.begin(), config.fixed_poses.end());
  const auto is_fixed = [&](KeyframeId id) {
    return std::binary_search(config.fixed_poses.begin(), config.fixed_poses.end(), id);
  };
  std::erase_if(config.constraints, [&](const PoseConstraint& one) {
    return !one.loop && is_fixed(one.a) && is_fixed(one.b);
  });
}

}  // namespace

Matrix7d motion_information(const MapSnapshot& map, KeyframeId a, KeyframeId b,
                            const Sim3d& a_from_b, const LoopGraphOptions& options) {
  const double translation = std::max(options.min_translation_sigma,
                                      options.translation_share * a_from_b.translation().norm());
  Vector7d sigma;
  sigma << Eigen::Vector3d::Constant(translation),
      Eigen::Vector3d::Constant(options.rotation_sigma),
      is_metric(map, a) && is_metric(map, b) ? options.metric_scale_sigma : options.scale_sigma;
  return sigma.cwiseProduct(sigma).cwiseInverse().asDiagonal();
}

ProblemConfig make_loop_graph(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
                              const LoopGraphOptions& options,
                              const std::vector<LoopEnds>& closed) {
  ProblemConfig config;
  config.options = options.problem;
  config.with_scale = options.with_scale;
  if (!map.origin().valid()) return config;
  config.fixed_poses = {map.origin()};
  config.variable_poses = map.keyframe_ids();
  std::erase(config.variable_poses, map.origin());

  Remembered remembered(map, options, config.constraints);
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    if (keyframe.parent.valid()) remembered.add(keyframe.parent, id);
    for (const Covisible& edge : keyframe.covisible) {
      if (edge.shared_landmarks >= options.min_shared_landmarks) remembered.add(edge.id, id);
    }
  }
  for (const auto& [a, b] : closed) remembered.add(a, b);
  for (const KeyframeId id : map.keyframe_ids()) {
    if (const auto& odometry = map.at(id).odometry) remembered.add(odometry->previous, id);
  }
  for (PoseConstraint loop : loops) {
    if (loop.information.isIdentity(0)) {
      if (map.find(loop.a) == nullptr || map.find(loop.b) == nullptr) continue;
      loop.information = motion_information(map, loop.a, loop.b, loop.a_from_b, options);
    }
    loop.loop = true;
    config.constraints.push_back(loop);
  }
  hold_what_stays(config);
  return config;
}

}  // namespace hybrid_slam
