#include "backend/problem/full_bundle.h"

#include <vector>

namespace hybrid_slam {

ProblemConfig make_full_bundle(const MapSnapshot& map, const FullBundleOptions& options) {
  ProblemConfig config;
  config.options = options.problem;
  if (!map.origin().valid()) return config;
  config.fixed_poses = {map.origin()};
  config.variable_poses = map.keyframe_ids();
  std::erase(config.variable_poses, map.origin());
  config.variable_landmarks = map.landmark_ids();
  return config;
}

}  // namespace hybrid_slam
