#pragma once

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

struct FullBundleOptions {
  ProblemOptions problem{.rounds = {{10, true, 1e-4}, {20, false, 1e-8}}};
};

// Bundle adjustment of every keyframe but the origin and of every landmark.
ProblemConfig make_full_bundle(const MapSnapshot& map, const FullBundleOptions& options);

}  // namespace hybrid_slam
