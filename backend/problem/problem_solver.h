#pragma once

#include <functional>
#include <stop_token>
#include <string>

#include "backend/problem/problem_builder.h"
#include "backend/problem/solve_graph.h"

namespace hybrid_slam {

struct SolveOutcome {
  SolveEnd end = SolveEnd::kEmpty;
  std::string text;
  int iterations = 0;  // steps that were tried
  double build_seconds = 0;
  double residual_seconds = 0;
  double jacobian_seconds = 0;
  double linear_solver_seconds = 0;
};

// The text of SolveEnd::kEmpty.
constexpr const char* kNothingVaries = "nothing varies, or nothing was observed";

// Runs one round on the active terms and moves the estimate of `graph`: trust region, landmarks
// eliminated first (Schur). A bundle adjustment with known cameras is solved by bundle_solver.h if
// the linear solver is kAuto; all else by Ceres, the reduced system dense, sparse or iterative by
// its size.
// Looks at `stop` after each iteration and keeps what it has. After kFailed the estimate is
// worthless: the caller drops it.
SolveOutcome solve_round(FactorGraph& graph, const GraphFactors& factors,
                         const ProblemOptions& options, const SolveRound& round,
                         const std::stop_token& stop,
                         const std::function<void(const IterationReport&)>& progress = {});

}  // namespace hybrid_slam
