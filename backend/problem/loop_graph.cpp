#include "backend/problem/loop_graph.h"

namespace hybrid_slam {

namespace {

Matrix7d edge_information(const LoopGraphOptions& options) {
  Vector7d sigma;
  sigma << Eigen::Vector3d::Constant(options.translation_sigma),
      Eigen::Vector3d::Constant(options.rotation_sigma), options.scale_sigma;
  return sigma.cwiseProduct(sigma).cwiseInverse().asDiagonal();
}

PoseConstraint remembered(const Keyframe& a, const Keyframe& b, const Matrix7d& information) {
  return {a.id, b.id, Sim3d(a.cam_from_world * inverse(b.cam_from_world)), information, false};
}

}  // namespace

ProblemConfig make_loop_graph(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
                              const LoopGraphOptions& options) {
  ProblemConfig config;
  config.options = options.problem;
  config.with_scale = options.with_scale;
  if (!map.origin().valid()) return config;
  config.fixed_poses = {map.origin()};
  config.variable_poses = map.keyframe_ids();
  std::erase(config.variable_poses, map.origin());

  const Matrix7d information = edge_information(options);
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    if (keyframe.parent.valid()) {
      config.constraints.push_back(remembered(map.at(keyframe.parent), keyframe, information));
    }
    for (const Covisible& edge : keyframe.covisible) {
      const bool once = edge.id < id;
      const bool in_tree = edge.id == keyframe.parent || map.at(edge.id).parent == id;
      if (once && !in_tree && edge.shared_landmarks >= options.min_shared_landmarks) {
        config.constraints.push_back(remembered(map.at(edge.id), keyframe, information));
      }
    }
  }
  for (PoseConstraint loop : loops) {
    if (loop.information.isIdentity(0)) loop.information = information;
    loop.loop = true;
    config.constraints.push_back(loop);
  }
  return config;
}

}  // namespace hybrid_slam
