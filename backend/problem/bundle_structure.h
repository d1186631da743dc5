#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "backend/problem/block_cholesky.h"
#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// An active observation, as the bundle solver reads it: all that it needs, in its order.
struct BundleTerm {
  static constexpr std::uint32_t kNoView = std::numeric_limits<std::uint32_t>::max();

  Eigen::Vector3d measurement;  // the third is NaN if the residual has two rows
  double sigma;
  std::uint32_t frame;
  std::uint32_t camera;
  int row;             // of the frame; BlockPattern::kNone if it is known
  std::uint32_t view;  // kNoView if the frame or the point is known
};

// Points that vary and that the same varying frames see. A pair of a point and a varying frame that
// sees it is a view; those of a group follow one another, point by point.
struct BundleGroup {
  std::uint32_t first_point = 0;  // into BundleStructure::points
  std::uint32_t end_point = 0;
  std::uint32_t first_row = 0;  // into BundleStructure::group_rows
  std::uint32_t end_row = 0;
  std::uint32_t first_view = 0;

  std::uint32_t row_count() const { return end_row - first_row; }
  std::uint32_t point_count() const { return end_point - first_point; }
  std::uint32_t view(std::uint32_t point, std::uint32_t k) const {
    return first_view + (point - first_point) * row_count() + k;
  }
};

// Which terms of a graph vary, in the order in which the bundle solver takes them, and where the
// blocks of the system lie that is left when the points are eliminated. Frames that vary and are in
// a term have a row of that system each.
struct BundleStructure {
  // active: per observation.
  BundleStructure(const FactorGraph& graph, const std::vector<char>& active);

  std::vector<std::uint32_t> points;       // of the graph: those that vary, then known ones
  std::uint32_t varying_points = 0;        // how many of them
  std::vector<std::uint32_t> first_terms;  // per point, and the number of all
  std::vector<BundleTerm> terms;           // of each point by row: those of a view side by side
  std::vector<BundleGroup> groups;
  std::vector<int> group_rows;  // ascending in each group
  std::uint32_t view_count = 0;
  std::vector<std::uint32_t> edges;  // of the graph, that vary
  std::vector<char> known;           // per frame: it has no row
  BlockPattern pattern;
  std::vector<std::uint32_t> frames;  // by row

  int rows() const { return pattern.rows(); }
  bool empty() const { return terms.empty() && edges.empty(); }
};

}  // namespace hybrid_slam
