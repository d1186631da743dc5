#pragma once

#include "backend/problem/factor_graph.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

// The bundle adjustment problem of a scene, at the truth: its frames in their order, the first one
// fixed, all landmarks, and the observations of those seen more than once.
FactorGraph scene_graph(const SyntheticSceneOptions& options);

}  // namespace hybrid_slam
