#pragma once

#include <cstdint>
#include <vector>

namespace hybrid_slam {

// Cliques of a block elimination, parents before children. Indices are those of the given graph.
struct EliminationClique {
  std::vector<std::uint32_t> frontals;   // eliminated here, in order
  std::vector<std::uint32_t> separator;  // eliminated in ancestors
  std::int32_t parent = -1;              // index of a clique before this one; -1 for a root
};

// Orders the vertices of a symmetric graph (adjacency lists, ascending, without the vertex itself)
// by constrained approximate minimum degree, those with last[v] = 1 at the end and those with 2
// behind them, and gathers them in cliques. A vertex joins its parent's clique if that costs at
// most `max_padding` blocks of zeros. `sizes`: rows per vertex; empty: all alike.
std::vector<EliminationClique> eliminate(const std::vector<std::vector<std::uint32_t>>& adjacency,
                                         const std::vector<char>& last, std::size_t max_padding,
                                         const std::vector<std::uint32_t>& sizes = {});

}  // namespace hybrid_slam
