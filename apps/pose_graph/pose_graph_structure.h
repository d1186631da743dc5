#pragma once

#include <vector>

#include "backend/problem/block_cholesky.h"
#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// What the edges of a graph say whatever the poses are.
struct PoseGraphStructure {
  explicit PoseGraphStructure(const FactorGraph& graph);

  // Frames whose pose holds the others': the fixed ones and, of each connected part without one,
  // the first.
  std::vector<char> known;
  std::vector<BlockPattern::Coupling> couplings;  // the frames of each edge
  BlockPattern pattern;                           // of the couplings
};

}  // namespace hybrid_slam
