#pragma once

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

struct FullBundleOptions {
  ProblemOptions problem{.rounds = {{10, Loss::kHuber, 1e-4}, {20, Loss::kNone, 1e-8}}};
  bool refine_intrinsics = false;  // of all cameras; a stereo pair keeps its baseline
};

// Bundle adjustment of every keyframe but the origin and of every landmark, with the odometry.
ProblemConfig make_full_bundle(const MapSnapshot& map, const FullBundleOptions& options);

}  // namespace hybrid_slam
