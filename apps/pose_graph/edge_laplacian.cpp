#include "apps/pose_graph/edge_laplacian.h"

namespace hybrid_slam {

template <int kRows>
bool solve_linear_edges(const BlockPattern& pattern,
                        const std::vector<BlockPattern::Coupling>& couplings,
                        const std::vector<LinearEdge<kRows>>& edges,
                        std::vector<Eigen::Matrix<double, kRows, 3>>& x) {
  if (pattern.rows() == 0) return true;
  BlockMatrix<kRows> matrix(pattern);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(kRows * pattern.rows(), 3);
  const auto identity = Eigen::Matrix<double, kRows, kRows>::Identity();
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto& [a, b] = couplings[e];
    const auto& [weight, map, offset] = edges[e];
    const int row_a = pattern.row(a);
    const int row_b = pattern.row(b);
    const bool joins_unknowns = pattern.slot(e).column != BlockPattern::kNone;
    if (row_a != BlockPattern::kNone) {
      matrix.add_to_diagonal(row_a, weight * identity);
      auto right_a = right.middleRows<kRows>(kRows * row_a);
      right_a += weight * offset;
      if (!joins_unknowns) right_a += weight * map * x[b];
    }
    if (row_b != BlockPattern::kNone) {
      matrix.add_to_diagonal(row_b, weight * identity);
      auto right_b = right.middleRows<kRows>(kRows * row_b);
      right_b -= weight * map.transpose() * offset;
      if (!joins_unknowns) right_b += weight * map.transpose() * x[a];
    }
    if (joins_unknowns) matrix.add(pattern.slot(e), -weight * map);
  }
  BlockCholesky cholesky;
  if (!cholesky.factorize(matrix.lower())) return false;
  const Eigen::MatrixXd solution = cholesky.solve(right);
  if (!solution.allFinite()) return false;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const int row = pattern.row(i);
    if (row != BlockPattern::kNone) x[i] = solution.middleRows<kRows>(kRows * row);
  }
  return true;
}

template bool solve_linear_edges<1>(const BlockPattern&, const std::vector<BlockPattern::Coupling>&,
                                    const std::vector<LinearEdge<1>>&,
                                    std::vector<Eigen::Matrix<double, 1, 3>>&);
template bool solve_linear_edges<3>(const BlockPattern&, const std::vector<BlockPattern::Coupling>&,
                                    const std::vector<LinearEdge<3>>&,
                                    std::vector<Eigen::Matrix<double, 3, 3>>&);

}  // namespace hybrid_slam
