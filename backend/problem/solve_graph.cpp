#include "backend/problem/solve_graph.h"

#include <ceres/cost_function.h>

#include <chrono>
#include <cmath>
#include <stdexcept>

#include "backend/problem/problem_solver.h"

namespace hybrid_slam {

namespace {

double half_sum(const std::vector<double>& observations, double edges) {
  double sum = edges;
  for (const double value : observations) {
    if (std::isfinite(value)) sum += value;
  }
  return sum / 2;
}

// Squared, of all that is no observation.
double others_chi2(const FactorGraph& graph, const GraphFactors& factors) {
  return 2 * half_sum(factors_chi2(graph, factors), edges_chi2(graph, factors));
}

// Of the active observations that project both before and after.
void write_kept_costs(const GraphFactors& factors, const std::vector<double>& before,
                      const std::vector<double>& after, double edges_before, double edges_after,
                      GraphSummary& summary) {
  summary.kept_initial_cost = edges_before / 2;
  summary.kept_final_cost = edges_after / 2;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (factors.active[i] == 0 || !std::isfinite(before[i]) || !std::isfinite(after[i])) continue;
    summary.kept_initial_cost += before[i] / 2;
    summary.kept_final_cost += after[i] / 2;
  }
}

// Observations beyond their threshold at the present estimate are set aside, others taken back.
void test_outliers(const FactorGraph& graph, const ProblemOptions& options,
                   const std::vector<double>& values, GraphFactors& factors) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool stereo = residual_count(graph, graph.observations[i]) == 3;
    factors.active[i] = values[i] <= (stereo ? options.chi2_stereo : options.chi2_mono);
  }
}

std::vector<std::uint32_t> inactive(const GraphFactors& factors) {
  std::vector<std::uint32_t> indices;
  for (std::size_t i = 0; i < factors.active.size(); ++i) {
    if (factors.active[i] == 0) indices.push_back(static_cast<std::uint32_t>(i));
  }
  return indices;
}

// The rounds, as far as they go.
void run_rounds(FactorGraph& graph, const ProblemOptions& options, const std::stop_token& stop,
                const std::function<void(const IterationReport&)>& progress, GraphFactors& factors,
                GraphSummary& summary) {
  for (std::size_t i = 0; i < options.rounds.size(); ++i) {
    if (i > 0) test_outliers(graph, options, observations_chi2(graph), factors);
    const auto report = [&](IterationReport iteration) {
      iteration.round = static_cast<int>(i);
      progress(iteration);
    };
    const SolveOutcome outcome =
        solve_round(graph, factors, options, options.rounds[i], stop,
                    progress ? std::function<void(const IterationReport&)>(report) : nullptr);
    summary.end = outcome.end;
    summary.text = outcome.text;
    summary.iterations += outcome.iterations;
    summary.build_seconds += outcome.build_seconds;
    summary.residual_seconds += outcome.residual_seconds;
    summary.jacobian_seconds += outcome.jacobian_seconds;
    summary.linear_solver_seconds += outcome.linear_solver_seconds;
    if (outcome.end != SolveEnd::kConverged && outcome.end != SolveEnd::kIterationLimit) break;
  }
}

// What a solve moves, to go back to.
struct Estimate {
  std::vector<GraphCamera> cameras;
  std::vector<GraphFrame> frames;
  std::vector<GraphPoint> points;
  std::vector<GraphSimilarity> similarities;
  std::vector<GraphBlock> blocks;

  explicit Estimate(const FactorGraph& graph)
      : cameras(graph.cameras),
        frames(graph.frames),
        points(graph.points),
        similarities(graph.similarities),
        blocks(graph.blocks) {}

  void restore(FactorGraph& graph) const {
    graph.cameras = cameras;
    graph.frames = frames;
    graph.points = points;
    graph.similarities = similarities;
    graph.blocks = blocks;
  }
};

void require(const std::string& wrong, const char* what) {
  if (!wrong.empty()) throw std::invalid_argument(what + wrong);
}

}  // namespace

std::string ProblemOptions::validate() const {
  if (rounds.empty()) return "rounds: at least one is needed";
  for (const SolveRound& round : rounds) {
    if (round.iterations < 1) return "rounds: iterations must be positive";
    if (!(round.function_tolerance >= 0)) return "rounds: tolerance must not be negative";
  }
  if (!(chi2_mono > 0) || !(chi2_stereo > 0) || !(chi2_loop > 0)) {
    return "chi2 thresholds must be positive";
  }
  if (!(trust_region > 0)) return "trust_region must be positive";
  if (!(max_seconds >= 0)) return "max_seconds must not be negative";
  if (threads < 1) return "threads must be positive";
  return {};
}

GraphSummary solve_graph(FactorGraph& graph, const ProblemOptions& options,
                         const std::stop_token& stop,
                         const std::function<void(const IterationReport&)>& progress) {
  const auto start = std::chrono::steady_clock::now();
  require(options.validate(), "ProblemOptions: ");
  require(graph.validate(), "FactorGraph: ");
  GraphFactors factors = make_factors(graph);
  const std::vector<double> before = observations_chi2(graph);
  for (std::size_t i = 0; i < before.size(); ++i) factors.active[i] = std::isfinite(before[i]);

  GraphSummary summary;
  summary.unprojectable = inactive(factors);
  const std::vector<double> factors_before = factors_chi2(graph, factors);
  for (std::size_t i = 0; i < factors_before.size(); ++i) {
    factors.factor_active[i] = std::isfinite(factors_before[i]);
  }
  const double edges_before = others_chi2(graph, factors);
  summary.initial_cost = half_sum(before, edges_before);
  const Estimate estimate(graph);
  run_rounds(graph, options, stop, progress, factors, summary);
  if (summary.end == SolveEnd::kFailed) estimate.restore(graph);
  const std::vector<double> after = observations_chi2(graph);
  const double edges_after = others_chi2(graph, factors);
  summary.final_cost = half_sum(after, edges_after);
  test_outliers(graph, options, after, factors);
  write_kept_costs(factors, before, after, edges_before, edges_after, summary);
  summary.outliers = inactive(factors);
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

double chi2(const FactorGraph& graph, const GraphEdge& edge) {
  FactorGraph single;
  single.frames = {graph.frames[edge.a], graph.frames[edge.b]};
  single.edges = {edge};
  single.edges[0].a = 0;
  single.edges[0].b = 1;
  return edges_chi2(single, make_factors(single));
}

double cost(const FactorGraph& graph) {
  const GraphFactors factors = make_factors(graph);
  return half_sum(observations_chi2(graph), others_chi2(graph, factors));
}

}  // namespace hybrid_slam
