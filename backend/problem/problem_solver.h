#pragma once

#include <stop_token>
#include <string>

#include "backend/problem/problem_builder.h"

namespace hybrid_slam {

struct SolveOutcome {
  SolveEnd end = SolveEnd::kEmpty;
  std::string text;
  int iterations = 0;  // steps that were tried
};

// Runs one round on the active terms and moves the estimate of `problem`: Ceres, trust region,
// landmarks eliminated first (Schur), the reduced system dense or sparse by its size. Looks at
// `stop` after each iteration and keeps what it has. After kFailed the estimate is worthless: the
// caller drops it.
SolveOutcome solve_round(AssembledProblem& problem, const ProblemOptions& options,
                         const SolveRound& round, const std::stop_token& stop);

// All rounds of a config on the values of a map, with the outliers tested between them. The engine
// of every bundle adjustment; they differ in their configs alone. Throws std::invalid_argument if
// the options are not valid.
BundleResult solve_bundle(const MapSnapshot& map, const ProblemConfig& config,
                          const std::stop_token& stop = {});

}  // namespace hybrid_slam
