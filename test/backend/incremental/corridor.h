#pragma once

#include <vector>

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// A straight run of stereo keyframes without any loop: as many landmarks in sight and as many
// keyframes that share them everywhere: eight, with a step of 1 m. From disturbed starts.
FactorGraph corridor_graph(int keyframes, int landmarks_per_step, double step = 1);

// Where its keyframes truly are, cam_from_world.
std::vector<Rigid3d> corridor_poses(int keyframes, double step = 1);

}  // namespace hybrid_slam
