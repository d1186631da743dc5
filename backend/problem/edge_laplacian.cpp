#include "backend/problem/edge_laplacian.h"

#include <limits>

#include <Eigen/CholmodSupport>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

namespace hybrid_slam {

namespace {

using SparseMatrix = Eigen::SparseMatrix<double>;
using Triplets = std::vector<Eigen::Triplet<double>>;

constexpr int kKnown = -1;

// For each node its block row in the normal equations, or kKnown: the unknown nodes in an order
// that keeps the Cholesky factor sparse (approximate minimum degree of the graph of blocks).
template <int kRows>
std::vector<int> block_rows(const std::vector<LinearEdge<kRows>>& edges,
                            const std::vector<char>& known) {
  std::vector<int> rows(known.size(), kKnown);
  int unknowns = 0;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (!known[i]) rows[i] = unknowns++;
  }
  Triplets entries;
  entries.reserve(2 * edges.size() + static_cast<std::size_t>(unknowns));
  for (int i = 0; i < unknowns; ++i) entries.emplace_back(i, i, 1);  // Eigen asks for a diagonal
  for (const auto& edge : edges) {
    const int a = rows[edge.a];
    const int b = rows[edge.b];
    if (a == kKnown || b == kKnown) continue;
    entries.emplace_back(a, b, 1);
    entries.emplace_back(b, a, 1);
  }
  SparseMatrix pattern(unknowns, unknowns);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::AMDOrdering<int>::PermutationType order;  // new position -> unknown
  Eigen::AMDOrdering<int>()(pattern, order);
  const Eigen::AMDOrdering<int>::PermutationType position(order.inverse());
  for (int& row : rows) {
    if (row != kKnown) row = position.indices()[row];
  }
  return rows;
}

template <int kRows>
void add_block(int row, int column, const Eigen::Matrix<double, kRows, kRows>& block,
               Triplets& lower) {
  for (int c = 0; c < kRows; ++c) {
    for (int r = row == column ? c : 0; r < kRows; ++r) {
      lower.emplace_back(kRows * row + r, kRows * column + c, block(r, c));
    }
  }
}

template <int kRows>
struct NormalEquations {
  SparseMatrix lower;
  Eigen::Matrix<double, Eigen::Dynamic, 3> right;
};

// The map being orthogonal, an edge adds a multiple of the identity to both diagonal blocks.
template <int kRows>
NormalEquations<kRows> normal_equations(const std::vector<LinearEdge<kRows>>& edges,
                                        const std::vector<int>& rows,
                                        const std::vector<Eigen::Matrix<double, kRows, 3>>& x) {
  int unknowns = 0;
  for (const int row : rows) unknowns += row != kKnown;
  NormalEquations<kRows> equations;
  equations.right.setZero(kRows * unknowns, 3);
  std::vector<double> diagonal(static_cast<std::size_t>(unknowns), 0);
  Triplets entries;
  entries.reserve(edges.size() * kRows * kRows + static_cast<std::size_t>(kRows * unknowns));
  for (const auto& edge : edges) {
    const int a = rows[edge.a];
    const int b = rows[edge.b];
    if (a != kKnown) {
      diagonal[static_cast<std::size_t>(a)] += edge.weight;
      auto right = equations.right.template middleRows<kRows>(kRows * a);
      right += edge.weight * edge.offset;
      if (b == kKnown) right += edge.weight * edge.map * x[edge.b];
    }
    if (b != kKnown) {
      diagonal[static_cast<std::size_t>(b)] += edge.weight;
      auto right = equations.right.template middleRows<kRows>(kRows * b);
      right -= edge.weight * edge.map.transpose() * edge.offset;
      if (a == kKnown) right += edge.weight * edge.map.transpose() * x[edge.a];
    }
    if (a == kKnown || b == kKnown) continue;
    if (a > b) {
      add_block<kRows>(a, b, -edge.weight * edge.map, entries);
    } else {
      add_block<kRows>(b, a, -edge.weight * edge.map.transpose(), entries);
    }
  }
  for (int i = 0; i < kRows * unknowns; ++i) {
    entries.emplace_back(i, i, diagonal[static_cast<std::size_t>(i / kRows)]);
  }
  equations.lower.resize(kRows * unknowns, kRows * unknowns);
  equations.lower.setFromTriplets(entries.begin(), entries.end());
  return equations;
}

}  // namespace

template <int kRows>
bool solve_linear_edges(const std::vector<LinearEdge<kRows>>& edges, const std::vector<char>& known,
                        std::vector<Eigen::Matrix<double, kRows, 3>>& x) {
  const std::vector<int> rows = block_rows(edges, known);
  const NormalEquations<kRows> equations = normal_equations(edges, rows, x);
  if (equations.lower.rows() == 0) return true;
  Eigen::CholmodDecomposition<SparseMatrix, Eigen::Lower> cholesky;
  cholesky.cholmod().nmethods = 1;
  cholesky.cholmod().method[0].ordering = CHOLMOD_NATURAL;
  cholesky.cholmod().print = 0;
  cholesky.compute(equations.lower);
  if (cholesky.info() != Eigen::Success) return false;
  const Eigen::Matrix<double, Eigen::Dynamic, 3> solution = cholesky.solve(equations.right);
  if (!solution.allFinite()) return false;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (rows[i] != kKnown) x[i] = solution.template middleRows<kRows>(kRows * rows[i]);
  }
  return true;
}

template bool solve_linear_edges<1>(const std::vector<LinearEdge<1>>&, const std::vector<char>&,
                                    std::vector<Eigen::Matrix<double, 1, 3>>&);
template bool solve_linear_edges<3>(const std::vector<LinearEdge<3>>&, const std::vector<char>&,
                                    std::vector<Eigen::Matrix<double, 3, 3>>&);

}  // namespace hybrid_slam
