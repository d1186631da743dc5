#include "backend/problem/solve_windows.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace hybrid_slam {

namespace {

constexpr std::uint32_t kAbsent = std::numeric_limits<std::uint32_t>::max();

// A part of a graph by itself: frames from `first` to `end` vary, unless they are known, and all
// points that they see.
class Window {
 public:
  Window(const FactorGraph& whole, std::size_t first, std::size_t end)
      : whole_(whole),
        first_(first),
        end_(end),
        frame_in_part_(whole.frames.size(), kAbsent),
        point_in_part_(whole.points.size(), kAbsent) {
    part_.cameras = whole.cameras;
    for (GraphCamera& camera : part_.cameras) camera.refined = 0;
    for (const GraphObservation& seen : whole.observations) {
      if (is_inside(seen.frame)) take_point(seen.point);
    }
    for (std::uint32_t i = 0; i < whole.observations.size(); ++i) {
      if (point_in_part_[whole.observations[i].point] != kAbsent) take_observation(i);
    }
    for (const GraphEdge& edge : whole.edges) {
      if (varies(edge.a) || varies(edge.b)) take_edge(edge);
    }
  }

  FactorGraph& part() { return part_; }
  const std::vector<std::uint32_t>& observations() const { return observations_; }

  void write_back(FactorGraph& whole) const {
    for (std::size_t i = 0; i < frames_.size(); ++i)
      whole.frames[frames_[i]].cam_from_world = part_.frames[i].cam_from_world;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      whole.points[points_[i]].in_world = part_.points[i].in_world;
    }
  }

 private:
  bool is_inside(std::uint32_t frame) const { return frame >= first_ && frame < end_; }
  bool varies(std::uint32_t frame) const { return is_inside(frame) && !whole_.frames[frame].fixed; }

  void take_point(std::uint32_t point) {
    if (point_in_part_[point] != kAbsent) return;
    point_in_part_[point] = static_cast<std::uint32_t>(points_.size());
    points_.push_back(point);
    part_.points.push_back(whole_.points[point]);
  }

  std::uint32_t take_frame(std::uint32_t frame) {
    std::uint32_t& taken = frame_in_part_[frame];
    if (taken != kAbsent) return taken;
    taken = static_cast<std::uint32_t>(frames_.size());
    frames_.push_back(frame);
    part_.frames.push_back(whole_.frames[frame]);
    part_.frames.back().fixed = !varies(frame);
    return taken;
  }

  void take_observation(std::uint32_t index) {
    GraphObservation seen = whole_.observations[index];
    seen.point = point_in_part_[seen.point];
    seen.frame = take_frame(seen.frame);
    observations_.push_back(index);
    part_.observations.push_back(seen);
  }

  void take_edge(GraphEdge edge) {
    edge.a = take_frame(edge.a);
    edge.b = take_frame(edge.b);
    part_.edges.push_back(edge);
  }

  const FactorGraph& whole_;
  std::size_t first_;
  std::size_t end_;
  FactorGraph part_;
  std::vector<std::uint32_t> frames_;        // of the whole, as part_.frames
  std::vector<std::uint32_t> points_;        // likewise
  std::vector<std::uint32_t> observations_;  // likewise
  std::vector<std::uint32_t> frame_in_part_;
  std::vector<std::uint32_t> point_in_part_;
};

// Sweeps over the graph, up and down in turn, end with one that gains less than this part of the
// cost: what is left is some times as much, and below a percent.
constexpr double kSettled = 1e-3;
constexpr int kMostSweeps = 10;

bool is_complete(SolveEnd end) {
  return end == SolveEnd::kConverged || end == SolveEnd::kIterationLimit;
}

// Where windows begin, up the graph.
std::vector<std::size_t> beginnings(std::size_t all, std::size_t frames) {
  const std::size_t step = std::max<std::size_t>(1, frames / 2);
  std::vector<std::size_t> up{0};
  while (up.back() + frames < all) up.push_back(up.back() + step);
  return up;
}

void add(const GraphSummary& window, GraphSummary& sum) {
  sum.iterations += window.iterations;
  sum.build_seconds += window.build_seconds;
  sum.residual_seconds += window.residual_seconds;
  sum.jacobian_seconds += window.jacobian_seconds;
  sum.linear_solver_seconds += window.linear_solver_seconds;
  if (window.end == SolveEnd::kEmpty || (window.end == SolveEnd::kFailed && is_complete(sum.end))) {
    return;
  }
  if (sum.end == SolveEnd::kIterationLimit && window.end == SolveEnd::kConverged) return;
  sum.end = window.end;
  sum.text = window.text;
}

std::vector<double> squared_residuals(const FactorGraph& graph) {
  std::vector<double> all;
  for (const GraphObservation& seen : graph.observations) all.push_back(chi2(graph, seen));
  return all;
}

double edges_cost(const FactorGraph& graph) {
  double sum = 0;
  for (const GraphEdge& edge : graph.edges) sum += chi2(graph, edge);
  return sum / 2;
}

// Of what can be evaluated, and of that what is kept.
void add_costs(const std::vector<double>& values, const std::vector<char>& is_outlier, double& all,
               double& kept) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    all += values[i] / 2;
    if (is_outlier[i] == 0) kept += values[i] / 2;
  }
}

}  // namespace

namespace {

// Windows one after the other. Returns by which part that lowered the cost of what they have.
double solve_one_by_one(FactorGraph& graph, const std::vector<std::size_t>& order,
                        std::size_t frames, const ProblemOptions& options,
                        const std::stop_token& stop, std::vector<char>& is_outlier,
                        GraphSummary& summary) {
  double before = 0;
  double after = 0;
  for (const std::size_t first : order) {
    Window window(graph, first, first + frames);
    const GraphSummary solved = solve_graph(window.part(), options, stop);
    window.write_back(graph);
    add(solved, summary);
    before += solved.kept_initial_cost;
    after += solved.kept_final_cost;
    if (is_complete(solved.end)) {
      for (const std::uint32_t i : window.observations()) is_outlier[i] = 0;
      for (const std::uint32_t i : solved.outliers) is_outlier[window.observations()[i]] = 1;
    }
    if (solved.end == SolveEnd::kStopped) break;
  }
  return before > 0 ? (before - after) / before : 0;
}

}  // namespace

GraphSummary solve_windows(FactorGraph& graph, std::size_t frames, const ProblemOptions& options,
                           const std::stop_token& stop) {
  const auto start = std::chrono::steady_clock::now();
  if (frames < 2) throw std::invalid_argument("solve_windows: windows of less than two frames");
  if (!graph.priors.empty() || !graph.similarities.empty() || !graph.factors.empty()) {
    throw std::invalid_argument("solve_windows: a graph of other terms");
  }
  if (const std::string wrong = graph.validate(); !wrong.empty()) {
    throw std::invalid_argument("FactorGraph: " + wrong);
  }
  GraphSummary summary;
  const std::vector<double> before = squared_residuals(graph);
  const double edges_before = edges_cost(graph);
  std::vector<char> is_outlier(graph.observations.size(), 0);
  std::vector<std::size_t> order = beginnings(graph.frames.size(), frames);
  const int sweeps = order.size() > 1 ? kMostSweeps : 1;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    const double gain = solve_one_by_one(graph, order, frames, options, stop, is_outlier, summary);
    if (summary.end == SolveEnd::kStopped || (sweep > 0 && gain < kSettled)) break;
    std::reverse(order.begin(), order.end());
  }
  const std::vector<double> after = squared_residuals(graph);
  summary.initial_cost = summary.kept_initial_cost = edges_before;
  summary.final_cost = summary.kept_final_cost = edges_cost(graph);
  add_costs(before, is_outlier, summary.initial_cost, summary.kept_initial_cost);
  add_costs(after, is_outlier, summary.final_cost, summary.kept_final_cost);
  for (std::uint32_t i = 0; i < before.size(); ++i) {
    if (!std::isfinite(before[i])) summary.unprojectable.push_back(i);
    if (is_outlier[i] != 0) summary.outliers.push_back(i);
  }
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace hybrid_slam
