#include "backend/problem/full_bundle.h"

#include <algorithm>
#include <vector>

#include "backend/problem/odometry_constraints.h"

namespace hybrid_slam {

ProblemConfig make_full_bundle(const MapSnapshot& map, const FullBundleOptions& options) {
  ProblemConfig config;
  config.options = options.problem;
  if (map.keyframe_count() > options.max_keyframes) {
    config.window = std::max<std::size_t>(2, options.max_keyframes);
  }
  if (!map.origin().valid()) return config;
  config.fixed_poses = {map.origin()};
  config.variable_poses = map.keyframe_ids();
  std::erase(config.variable_poses, map.origin());
  config.variable_landmarks = map.landmark_ids();
  config.constraints = odometry_constraints(map, config.variable_poses);
  for (std::uint32_t i = 0; options.refine_intrinsics && i < map.camera_count(); ++i) {
    config.refined_cameras.emplace_back(i);
  }
  return config;
}

}  // namespace hybrid_slam
