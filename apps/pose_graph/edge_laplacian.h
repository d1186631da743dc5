#pragma once

#include <vector>

#include <Eigen/Core>

#include "backend/problem/block_cholesky.h"

namespace hybrid_slam {

// One coupling (a, b) of a linear problem on a graph: weight * |x_a - map * x_b - offset|^2, where
// each node's x is a matrix of kRows rows and 3 columns. The map is orthogonal.
template <int kRows>
struct LinearEdge {
  double weight = 1;
  Eigen::Matrix<double, kRows, kRows> map;
  Eigen::Matrix<double, kRows, 3> offset;
};

// Minimises the sum over the couplings, with the known nodes held at their x, and overwrites the
// others. False, and x as it was, if the normal equations are singular: a part of the graph without
// a known node. `pattern` is that of the couplings.
template <int kRows>
bool solve_linear_edges(const BlockPattern& pattern,
                        const std::vector<BlockPattern::Coupling>& couplings,
                        const std::vector<LinearEdge<kRows>>& edges,
                        std::vector<Eigen::Matrix<double, kRows, 3>>& x);

extern template bool solve_linear_edges<1>(const BlockPattern&,
                                           const std::vector<BlockPattern::Coupling>&,
                                           const std::vector<LinearEdge<1>>&,
                                           std::vector<Eigen::Matrix<double, 1, 3>>&);
extern template bool solve_linear_edges<3>(const BlockPattern&,
                                           const std::vector<BlockPattern::Coupling>&,
                                           const std::vector<LinearEdge<3>>&,
                                           std::vector<Eigen::Matrix<double, 3, 3>>&);

}  // namespace hybrid_slam
