#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace hybrid_slam {

// One term of a linear problem on a graph: weight * |x_a - map * x_b - offset|^2, where each node's
// x is a matrix of kRows rows.
template <int kRows>
struct LinearEdge {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  double weight = 1;
  Eigen::Matrix<double, kRows, kRows> map;
  Eigen::Matrix<double, kRows, 3> offset;
};

// Minimises the sum over the edges, with the nodes marked in `known` held at their x, and
// overwrites the others: sparse normal equations of kRows x kRows blocks by Cholesky (CHOLMOD).
// Requires orthogonal maps. False, and x as it was, if they are singular: a part of the graph
// without a known node.
template <int kRows>
bool solve_linear_edges(const std::vector<LinearEdge<kRows>>& edges, const std::vector<char>& known,
                        std::vector<Eigen::Matrix<double, kRows, 3>>& x);

extern template bool solve_linear_edges<1>(const std::vector<LinearEdge<1>>&,
                                           const std::vector<char>&,
                                           std::vector<Eigen::Matrix<double, 1, 3>>&);
extern template bool solve_linear_edges<3>(const std::vector<LinearEdge<3>>&,
                                           const std::vector<char>&,
                                           std::vector<Eigen::Matrix<double, 3, 3>>&);

}  // namespace hybrid_slam
