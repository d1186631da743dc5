#pragma once

#include <functional>
#include <stop_token>

#include "backend/problem/problem_solver.h"

namespace hybrid_slam {

// Whether solve_bundle_round() takes a graph: observations by cameras that are known, at least one,
// and edges; no terms and no variables of other kinds.
bool is_plain_bundle(const FactorGraph& graph);

// solve_round() of such a graph, by a solver of our own: the steps are those of Ceres' trust region
// (Levenberg-Marquardt, with its defaults), so that costs and the result agree with it to rounding,
// at a fraction of the price (docs/backend.md). One thread, whatever the options say: the result is
// the same, bit by bit, each time. The graph must be finite.
SolveOutcome solve_bundle_round(FactorGraph& graph, const GraphFactors& factors,
                                const ProblemOptions& options, const SolveRound& round,
                                const std::stop_token& stop,
                                const std::function<void(const IterationReport&)>& progress);

}  // namespace hybrid_slam
