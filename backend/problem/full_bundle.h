#pragma once

#include <cstddef>

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

struct FullBundleOptions {
  ProblemOptions problem{.rounds = {{10, Loss::kHuber, 1e-4}, {20, Loss::kNone, 1e-8}}};
  bool enabled = true;  // after a loop was closed
  // That vary at once. A larger map is adjusted in windows of so many (solve_windows.h).
  std::size_t max_keyframes = 1000;
  bool refine_intrinsics =
      false;  // of all cameras; a stereo pair keeps its baseline; not in windows
};

// Bundle adjustment of every keyframe but the origin and of every landmark, with the odometry.
ProblemConfig make_full_bundle(const MapSnapshot& map, const FullBundleOptions& options);

}  // namespace hybrid_slam
