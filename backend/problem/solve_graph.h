#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "backend/problem/factor_graph.h"
#include "backend/problem/observation_chi2.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// Where the solver stands: after the evaluation of the start (iteration 0) and after each step.
struct IterationReport {
  int round = 0;
  int iteration = 0;
  double cost = 0;  // half the sum of squares, with the round's loss
  double step_norm = 0;
  double seconds = 0;  // since the round began
};

struct GraphSummary {
  SolveEnd end = SolveEnd::kEmpty;
  std::string text;  // why it ended, for people
  // Half the squared whitened residuals of every term that can be evaluated, without a loss.
  double initial_cost = 0;
  double final_cost = 0;
  // The same of the terms that are no outliers at the end.
  double kept_initial_cost = 0;
  double kept_final_cost = 0;
  int iterations = 0;
  std::vector<std::uint32_t> unprojectable;  // observations left out: their point does not project
  std::vector<std::uint32_t> outliers;       // observations beyond their chi2 threshold at the end
  // Phases: preprocessing, residuals, Jacobians, linear solver [s, wall clock].
  double build_seconds = 0;
  double residual_seconds = 0;
  double jacobian_seconds = 0;
  double linear_solver_seconds = 0;
  double seconds = 0;
};

// Runs the rounds of `options` on a graph and moves its estimate: poses, points, blocks and the
// refined camera parameters. Factors whose function fails at the start are left out. The gauge is
// held by what is fixed. After SolveEnd::kFailed the graph is as it was. Throws
// std::invalid_argument if the graph or the options are not valid.
GraphSummary solve_graph(FactorGraph& graph, const ProblemOptions& options,
                         const std::stop_token& stop = {},
                         const std::function<void(const IterationReport&)>& progress = {});

// Squared whitened residual of an edge; that of an observation: observation_chi2.h.
double chi2(const FactorGraph& graph, const GraphEdge& edge);

// Half the sum of squares of all observations that project, all edges, priors and factors.
double cost(const FactorGraph& graph);

}  // namespace hybrid_slam
