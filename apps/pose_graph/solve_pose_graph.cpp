#include "apps/pose_graph/solve_pose_graph.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>

#include "apps/pose_graph/pose_graph_descent.h"

namespace hybrid_slam {

namespace {

struct Candidate {
  PoseGraphStart start = PoseGraphStart::kGiven;
  std::vector<Rigid3d> poses;
  double cost = 0;
};

void set_poses(const std::vector<Rigid3d>& poses, FactorGraph& graph) {
  for (std::size_t i = 0; i < poses.size(); ++i) graph.frames[i].cam_from_world = poses[i];
}

std::vector<Rigid3d> poses_of(const FactorGraph& graph) {
  std::vector<Rigid3d> poses;
  poses.reserve(graph.frames.size());
  for (const GraphFrame& frame : graph.frames) poses.push_back(frame.cam_from_world);
  return poses;
}

SolveEnd end_of(DescentEnd end) {
  switch (end) {
    case DescentEnd::kConverged:
      return SolveEnd::kConverged;
    case DescentEnd::kStopped:
      return SolveEnd::kStopped;
    default:
      return SolveEnd::kIterationLimit;
  }
}

class PoseGraphSolver {
 public:
  PoseGraphSolver(const FactorGraph& graph, const PoseGraphOptions& options,
                  const std::stop_token& stop,
                  const std::function<void(const IterationReport&)>& progress)
      : graph_(graph), options_(options), stop_(stop), progress_(progress), problem_(graph) {
    for (const PoseGraphStart start : options.starts) {
      Candidate candidate{start, start_poses(graph, problem_.structure(), start), 0};
      candidate.cost = problem_.cost(candidate.poses);
      candidates_.push_back(std::move(candidate));
    }
    std::stable_sort(candidates_.begin(), candidates_.end(),
                     [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  }

  PoseGraphSummary solve() {
    PoseGraphSummary best;
    best.summary.end = SolveEnd::kEmpty;
    std::vector<Rigid3d> best_poses = poses_of(graph_);
    double lowest = problem_.cost(best_poses);
    best.summary.initial_cost = lowest;
    for (Candidate& candidate : candidates_) {
      const double start_cost = candidate.cost;
      const GraphSummary summary = solve_from(candidate);
      best.attempts.push_back({candidate.start, start_cost, candidate.cost});
      best.summary.iterations += summary.iterations;
      if (best.attempts.size() == 1 || candidate.cost < lowest) {
        best.summary.end = summary.end;
        best.summary.text = summary.text;
      }
      if (candidate.cost < lowest) {
        lowest = candidate.cost;
        best.start = candidate.start;
        best_poses = std::move(candidate.poses);
      }
      if (stop_.stop_requested() || explains_noise(lowest)) break;
    }
    best.summary.final_cost = lowest;
    poses = std::move(best_poses);
    return best;
  }

  std::vector<Rigid3d> poses;  // the solution

 private:
  bool explains_noise(double cost) const {
    const auto edges = static_cast<double>(graph_.edges.size());
    const double expected = 6 * (edges - problem_.structure().pattern.rows());
    return 2 * cost <= options_.enough * expected;
  }

  // Moves the candidate, downhill only.
  GraphSummary solve_from(Candidate& candidate) {
    GraphSummary summary;
    const PoseGraphDescent descent = problem_.descend(
        candidate.poses, {options_.iterations, options_.function_tolerance}, stop_, reporter());
    candidate.cost = descent.cost;
    summary.iterations = descent.iterations;
    summary.end = end_of(descent.end);
    summary.text = "Gauss-Newton, " + std::to_string(descent.factorizations) + " factorisations";
    if (descent.end != DescentEnd::kUphill) return summary;
    FactorGraph moved = graph_;
    set_poses(candidate.poses, moved);
    for (std::size_t i = 0; i < moved.frames.size(); ++i) {
      moved.frames[i].fixed = problem_.structure().known[i];
    }
    summary = solve_graph(moved, trust_region_options(), stop_, progress_);
    summary.iterations += descent.iterations;
    candidate.poses = poses_of(moved);
    candidate.cost = summary.final_cost;
    return summary;
  }

  ProblemOptions trust_region_options() const {
    ProblemOptions options;
    options.rounds.assign(1, {options_.iterations, Loss::kNone, options_.function_tolerance});
    return options;
  }

  std::function<void(int, double)> reporter() const {
    if (!progress_) return {};
    return [this](int iteration, double cost) {
      IterationReport report;
      report.iteration = iteration;
      report.cost = cost;
      progress_(report);
    };
  }

  const FactorGraph& graph_;
  const PoseGraphOptions& options_;
  const std::stop_token& stop_;
  const std::function<void(const IterationReport&)>& progress_;
  PoseGraphProblem problem_;
  std::vector<Candidate> candidates_;
};

void require_valid(const std::string& wrong, const char* what) {
  if (!wrong.empty()) throw std::invalid_argument(what + wrong);
}

}  // namespace

std::string PoseGraphOptions::validate() const {
  if (starts.empty()) return "starts: at least one is needed";
  if (!(enough >= 0)) return "enough must not be negative";
  if (iterations < 1) return "iterations must be positive";
  if (!(function_tolerance >= 0)) return "tolerance must not be negative";
  return {};
}

bool is_pose_graph(const FactorGraph& graph) {
  return !graph.edges.empty() && graph.observations.empty() && graph.similarity_edges.empty() &&
         graph.factors.empty();
}

PoseGraphSummary solve_pose_graph(FactorGraph& graph, const PoseGraphOptions& options,
                                  const std::stop_token& stop,
                                  const std::function<void(const IterationReport&)>& progress) {
  const auto begin = std::chrono::steady_clock::now();
  require_valid(options.validate(), "PoseGraphOptions: ");
  require_valid(graph.validate(), "FactorGraph: ");
  require_valid(is_pose_graph(graph) ? "" : "not a pose graph", "FactorGraph: ");
  PoseGraphSolver solver(graph, options, stop, progress);
  PoseGraphSummary result = solver.solve();
  set_poses(solver.poses, graph);
  result.summary.kept_initial_cost = result.summary.initial_cost;
  result.summary.kept_final_cost = result.summary.final_cost;
  result.summary.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace hybrid_slam
