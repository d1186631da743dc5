#include "backend/incremental/elimination_order.h"

#include <camd.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace hybrid_slam {

namespace {

// Vertices as they are numbered, the last ones at the end.
std::vector<std::uint32_t> time_order(const std::vector<char>& last) {
  std::vector<std::uint32_t> order(last.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return last[a] < last[b]; });
  return order;
}

// Vertices by constrained approximate minimum degree.
std::vector<std::uint32_t> minimum_degree_order(
    const std::vector<std::vector<std::uint32_t>>& adjacency, const std::vector<char>& last) {
  const auto n = static_cast<int>(adjacency.size());
  std::vector<int> starts{0};
  std::vector<int> rows;
  for (const auto& neighbours : adjacency) {
    for (const std::uint32_t v : neighbours) rows.push_back(static_cast<int>(v));
    starts.push_back(static_cast<int>(rows.size()));
  }
  if (rows.empty()) return time_order(last);
  std::vector<int> constraints(last.begin(), last.end());
  // CAMD wants groups below the number of vertices: without a gap they are.
  if (std::find(last.begin(), last.end(), 1) == last.end()) {
    for (int& group : constraints) group /= 2;
  }
  if (std::find(last.begin(), last.end(), 0) == last.end() &&
      std::find(last.begin(), last.end(), 2) != last.end()) {
    for (int& group : constraints) group = std::max(group - 1, 0);
  }
  std::vector<int> permutation(adjacency.size());
  double control[CAMD_CONTROL];
  camd_defaults(control);
  const int status = camd_order(n, starts.data(), rows.data(), permutation.data(), control, nullptr,
                                constraints.data());
  if (status != CAMD_OK && status != CAMD_OK_BUT_JUMBLED) {
    throw std::logic_error("elimination order: the graph is not valid");
  }
  return {permutation.begin(), permutation.end()};
}

// Per position in the order: the later positions that its elimination joins, ascending.
std::vector<std::vector<std::uint32_t>> structures(
    const std::vector<std::vector<std::uint32_t>>& adjacency,
    const std::vector<std::uint32_t>& order) {
  const std::size_t n = order.size();
  std::vector<std::uint32_t> position(n);
  for (std::uint32_t k = 0; k < n; ++k) position[order[k]] = k;
  std::vector<std::vector<std::uint32_t>> result(n);
  std::vector<std::vector<std::uint32_t>> children(n);
  std::vector<std::uint32_t> mark(n, static_cast<std::uint32_t>(n));
  for (std::uint32_t k = 0; k < n; ++k) {
    auto& rows = result[k];
    const auto add = [&](std::uint32_t row) {
      if (row > k && mark[row] != k) {
        mark[row] = k;
        rows.push_back(row);
      }
    };
    for (const std::uint32_t v : adjacency[order[k]]) add(position[v]);
    for (const std::uint32_t child : children[k]) {
      for (const std::uint32_t row : result[child]) add(row);
    }
    std::sort(rows.begin(), rows.end());
    if (!rows.empty()) children[rows.front()].push_back(k);
  }
  return result;
}

// The order in time may cost so many times as much as the other. It pays later: what the next
// additions touch was mostly added recently, and stays near the root.
constexpr double kPatience = 2;

// Multiplications of the elimination of vertices of these sizes, or of one row each.
double cost_of(const std::vector<std::vector<std::uint32_t>>& rows,
               const std::vector<std::uint32_t>& vertex, const std::vector<std::uint32_t>& sizes) {
  double cost = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (sizes.empty()) {
      const auto n = static_cast<double>(rows[k].size() + 1);
      cost += n * n;
      continue;
    }
    const double own = sizes[vertex[k]];
    double n = own;
    for (const std::uint32_t row : rows[k]) n += sizes[vertex[row]];
    cost += own * n * n;
  }
  return cost;
}

}  // namespace

std::vector<EliminationClique> eliminate(const std::vector<std::vector<std::uint32_t>>& adjacency,
                                         const std::vector<char>& last, std::size_t max_padding,
                                         const std::vector<std::uint32_t>& sizes) {
  std::vector<std::uint32_t> vertex = minimum_degree_order(adjacency, last);
  auto rows = structures(adjacency, vertex);
  std::vector<std::uint32_t> in_time = time_order(last);
  auto rows_in_time = structures(adjacency, in_time);
  if (cost_of(rows_in_time, in_time, sizes) <= kPatience * cost_of(rows, vertex, sizes)) {
    vertex = std::move(in_time);
    rows = std::move(rows_in_time);
  }
  std::vector<EliminationClique> cliques;
  std::vector<std::int32_t> clique_of(vertex.size(), -1);
  for (std::size_t k = vertex.size(); k-- > 0;) {
    const std::int32_t parent = rows[k].empty() ? -1 : clique_of[rows[k].front()];
    if (parent >= 0) {
      EliminationClique& above = cliques[static_cast<std::size_t>(parent)];
      if (above.frontals.size() + above.separator.size() <= rows[k].size() + max_padding) {
        above.frontals.push_back(vertex[k]);
        clique_of[k] = parent;
        continue;
      }
    }
    EliminationClique made{{vertex[k]}, {}, parent};
    for (const std::uint32_t row : rows[k]) made.separator.push_back(vertex[row]);
    clique_of[k] = static_cast<std::int32_t>(cliques.size());
    cliques.push_back(std::move(made));
  }
  for (EliminationClique& clique : cliques) {
    std::reverse(clique.frontals.begin(), clique.frontals.end());
  }
  return cliques;
}

}  // namespace hybrid_slam
