#include "backend/problem/bundle_structure.h"

#include <algorithm>
#include <numeric>
#include <span>

#include "backend/problem/observation_chi2.h"

namespace hybrid_slam {

namespace {

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

bool is_sought(const FactorGraph& graph, const GraphObservation& seen) {
  return !graph.frames[seen.frame].fixed || !graph.points[seen.point].fixed;
}

// The indices of the observations that are in the problem, point by point.
struct ByPoint {
  std::vector<std::uint32_t> first;  // per point of the graph, and the number of all
  std::vector<std::uint32_t> observations;

  ByPoint(const FactorGraph& graph, const std::vector<char>& active)
      : first(graph.points.size() + 1, 0) {
    const auto each = [&](const auto& take) {
      for (std::uint32_t i = 0; i < graph.observations.size(); ++i) {
        const GraphObservation& seen = graph.observations[i];
        if (active[i] != 0 && is_sought(graph, seen)) take(i, seen.point);
      }
    };
    each([&](std::uint32_t, std::uint32_t point) { ++first[point + 1]; });
    std::partial_sum(first.begin(), first.end(), first.begin());
    observations.resize(first.back());
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    each([&](std::uint32_t i, std::uint32_t point) { observations[next[point]++] = i; });
  }

  auto begin(std::uint32_t point) const { return observations.begin() + first[point]; }
  auto end(std::uint32_t point) const { return observations.begin() + first[point + 1]; }
};

std::vector<std::uint32_t> varying_edges(const FactorGraph& graph) {
  std::vector<std::uint32_t> edges;
  for (std::uint32_t i = 0; i < graph.edges.size(); ++i) {
    const GraphEdge& edge = graph.edges[i];
    if (!graph.frames[edge.a].fixed || !graph.frames[edge.b].fixed) edges.push_back(i);
  }
  return edges;
}

std::vector<char> known_frames(const FactorGraph& graph, const ByPoint& seen,
                               const std::vector<std::uint32_t>& edges) {
  std::vector<char> known(graph.frames.size(), 1);
  const auto use = [&](std::uint32_t frame) {
    if (!graph.frames[frame].fixed) known[frame] = 0;
  };
  for (const std::uint32_t i : seen.observations) use(graph.observations[i].frame);
  for (const std::uint32_t i : edges) {
    use(graph.edges[i].a);
    use(graph.edges[i].b);
  }
  return known;
}

// The pairs of frames that an edge or a point that varies joins, the first one less than the
// second, each pair once.
std::vector<BlockPattern::Coupling> couplings_of(const FactorGraph& graph, const ByPoint& seen,
                                                 const std::vector<std::uint32_t>& edges,
                                                 const std::vector<char>& known) {
  std::vector<std::uint32_t> unknown;
  std::vector<std::size_t> index(known.size(), 0);
  for (std::uint32_t i = 0; i < known.size(); ++i) {
    if (known[i] != 0) continue;
    index[i] = unknown.size();
    unknown.push_back(i);
  }
  std::vector<bool> joined(unknown.size() * unknown.size(), false);
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    if (known[a] == 0 && known[b] == 0 && a < b)
      joined[index[a] * unknown.size() + index[b]] = true;
  };
  for (std::uint32_t point = 0; point < graph.points.size(); ++point) {
    if (graph.points[point].fixed) continue;
    for (auto a = seen.begin(point); a != seen.end(point); ++a) {
      for (auto b = seen.begin(point); b != seen.end(point); ++b) {
        join(graph.observations[*a].frame, graph.observations[*b].frame);
      }
    }
  }
  for (const std::uint32_t i : edges) {
    join(graph.edges[i].a, graph.edges[i].b);
    join(graph.edges[i].b, graph.edges[i].a);
  }
  std::vector<BlockPattern::Coupling> couplings;
  for (std::size_t a = 0; a < unknown.size(); ++a) {
    for (std::size_t b = a + 1; b < unknown.size(); ++b) {
      if (joined[a * unknown.size() + b]) couplings.emplace_back(unknown[a], unknown[b]);
    }
  }
  return couplings;
}

class BundleAssembler {
 public:
  BundleAssembler(const FactorGraph& graph, ByPoint& seen, BundleStructure& made)
      : graph_(graph), seen_(seen), made_(made) {}

  void assemble() {
    made_.frames.resize(static_cast<std::size_t>(made_.rows()));
    for (std::uint32_t i = 0; i < graph_.frames.size(); ++i) {
      if (made_.known[i] == 0) made_.frames[static_cast<std::size_t>(row(i))] = i;
    }
    list_rows();
    order_points();
    made_.terms.reserve(seen_.observations.size());
    for (std::uint32_t p = 0; p < made_.points.size(); ++p) {
      made_.first_terms.push_back(static_cast<std::uint32_t>(made_.terms.size()));
      if (p < made_.varying_points) enter_group(p);
      add_terms(p);
    }
    made_.first_terms.push_back(static_cast<std::uint32_t>(made_.terms.size()));
  }

 private:
  using Rows = std::span<const int>;

  int row(std::uint32_t frame) const { return made_.pattern.row(frame); }

  // What each point's varying frames are: their rows, ascending.
  void list_rows() {
    first_rows_.reserve(graph_.points.size() + 1);
    for (std::uint32_t point = 0; point < graph_.points.size(); ++point) {
      first_rows_.push_back(rows_.size());
      const auto row_of = [&](std::uint32_t i) { return row(graph_.observations[i].frame); };
      const auto begin = seen_.observations.begin() + seen_.first[point];
      const auto end = seen_.observations.begin() + seen_.first[point + 1];
      std::stable_sort(begin, end, [&](auto a, auto b) { return row_of(a) < row_of(b); });
      for (auto i = begin; i != end; ++i) {
        const bool again = rows_.size() > first_rows_.back() && rows_.back() == row_of(*i);
        if (row_of(*i) != BlockPattern::kNone && !again) rows_.push_back(row_of(*i));
      }
    }
    first_rows_.push_back(rows_.size());
  }

  Rows rows_of(std::uint32_t point) const {
    return Rows(rows_).subspan(first_rows_[point], first_rows_[point + 1] - first_rows_[point]);
  }

  // Points with the same frames side by side, known ones last.
  void order_points() {
    for (std::uint32_t i = 0; i < graph_.points.size(); ++i) {
      if (seen_.first[i] < seen_.first[i + 1]) made_.points.push_back(i);
    }
    const auto middle =
        std::stable_partition(made_.points.begin(), made_.points.end(),
                              [&](std::uint32_t i) { return !graph_.points[i].fixed; });
    made_.varying_points = static_cast<std::uint32_t>(middle - made_.points.begin());
    std::stable_sort(made_.points.begin(), middle, [&](std::uint32_t a, std::uint32_t b) {
      return std::ranges::lexicographical_compare(rows_of(a), rows_of(b));
    });
  }

  void enter_group(std::uint32_t p) {
    const Rows rows = rows_of(made_.points[p]);
    if (p == 0 || !std::ranges::equal(rows, rows_of(made_.points[p - 1]))) {
      BundleGroup group;
      group.first_point = p;
      group.first_row = static_cast<std::uint32_t>(made_.group_rows.size());
      made_.group_rows.insert(made_.group_rows.end(), rows.begin(), rows.end());
      group.end_row = static_cast<std::uint32_t>(made_.group_rows.size());
      group.first_view = made_.view_count;
      made_.groups.push_back(group);
    }
    made_.groups.back().end_point = p + 1;
    made_.view_count += static_cast<std::uint32_t>(rows.size());
  }

  // Of one point; several observations of a frame share their view.
  void add_terms(std::uint32_t p) {
    const std::uint32_t point = made_.points[p];
    const Rows rows = rows_of(point);
    std::size_t k = 0;
    for (auto i = seen_.begin(point); i != seen_.end(point); ++i) {
      const GraphObservation& seen = graph_.observations[*i];
      const int frame_row = row(seen.frame);
      std::uint32_t view = BundleTerm::kNoView;
      if (p < made_.varying_points && frame_row != BlockPattern::kNone) {
        while (rows[k] != frame_row) ++k;
        view = made_.groups.back().view(p, static_cast<std::uint32_t>(k));
      }
      made_.terms.push_back({seen.measurement, seen.sigma, seen.frame,
                             graph_.frames[seen.frame].camera, frame_row, view});
      if (residual_count(graph_, seen) == 2) made_.terms.back().measurement[2] = kNotMeasured;
    }
  }

  const FactorGraph& graph_;
  ByPoint& seen_;
  BundleStructure& made_;
  std::vector<int> rows_;                // point by point
  std::vector<std::size_t> first_rows_;  // per point of the graph
};

}  // namespace

BundleStructure::BundleStructure(const FactorGraph& graph, const std::vector<char>& active) {
  ByPoint seen(graph, active);
  edges = varying_edges(graph);
  known = known_frames(graph, seen, edges);
  pattern = BlockPattern(couplings_of(graph, seen, edges, known), known);
  BundleAssembler(graph, seen, *this).assemble();
}

}  // namespace hybrid_slam
