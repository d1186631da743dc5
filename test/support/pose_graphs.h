#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "backend/problem/factor_graph.h"
#include "test/support/random.h"

namespace hybrid_slam {

// A pose graph with the poses from which its measurements were made. The given poses are the true
// ones; the first frame is fixed.
struct TestPoseGraph {
  FactorGraph graph;
  std::vector<Rigid3d> truth;  // cam_from_world
};

struct PoseNoise {
  double translation = 0;  // standard deviation per axis [m]
  double rotation = 0;     // [rad]
};

// Poses on a grid of unit spacing with random attitudes, and an edge between neighbours. The
// information is that of the noise, or of 0.01 m and 0.01 rad without.
TestPoseGraph grid_pose_graph(const std::array<int, 3>& size, const PoseNoise& noise,
                              Random& random);

// A closed polygon of `count` poses one metre apart that look ahead. Information as above.
TestPoseGraph ring_pose_graph(int count, const PoseNoise& noise, Random& random);

// Sets the poses of all but the fixed frames to random ones.
void scatter(FactorGraph& graph, Random& random);

}  // namespace hybrid_slam
