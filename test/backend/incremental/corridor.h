#pragma once

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// A straight run of stereo keyframes without any loop: as many landmarks in sight and as many
// keyframes that share them everywhere. From disturbed starts.
FactorGraph corridor_graph(int keyframes, int landmarks_per_step);

}  // namespace hybrid_slam
