#include <chrono>
#include <cmath>
#include <stdexcept>

#include "backend/problem/problem_solver.h"

namespace hybrid_slam {

namespace {

std::vector<double> all_chi2(const AssembledProblem& problem) {
  std::vector<double> values;
  values.reserve(problem.terms.size());
  for (const ProblemTerm& term : problem.terms) values.push_back(chi2(problem, term));
  return values;
}

// Terms beyond their threshold at the present estimate are set aside, others taken back.
void test_outliers(AssembledProblem& problem, const ProblemOptions& options,
                   const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    ProblemTerm& term = problem.terms[i];
    term.active = values[i] <= (term.stereo ? options.chi2_stereo : options.chi2_mono);
  }
}

void drop_unprojectable(AssembledProblem& problem, const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    problem.terms[i].active = std::isfinite(values[i]);
  }
}

void write_estimate(const ProblemConfig& config, const AssembledProblem& problem,
                    BundleResult& result) {
  std::vector<char> pose_used(problem.poses.size(), 0);
  std::vector<char> point_used(problem.points.size(), 0);
  for (const ProblemTerm& term : problem.terms) {
    pose_used[term.pose] = point_used[term.point] = 1;
  }
  for (std::size_t i = 0; i < problem.variable_poses; ++i) {
    if (pose_used[i]) {
      result.cam_from_world.emplace_back(config.variable_poses[i], problem.poses[i]);
    }
  }
  for (std::size_t i = 0; i < problem.variable_points; ++i) {
    if (point_used[i]) {
      result.point_in_world.emplace_back(config.variable_landmarks[i], problem.points[i]);
    }
  }
}

void write_costs(const AssembledProblem& problem, const std::vector<double>& before,
                 const std::vector<double>& after, BundleSummary& summary) {
  for (std::size_t i = 0; i < problem.terms.size(); ++i) {
    if (!problem.terms[i].active || !std::isfinite(before[i]) || !std::isfinite(after[i])) continue;
    summary.initial_cost += before[i] / 2;
    summary.final_cost += after[i] / 2;
    ++summary.observations;
  }
}

// The rounds, as far as they go; an outcome other than kStopped, kFailed or kEmpty means all.
SolveOutcome run_rounds(AssembledProblem& problem, const ProblemOptions& options,
                        const std::stop_token& stop) {
  SolveOutcome last;
  int iterations = 0;
  for (std::size_t i = 0; i < options.rounds.size(); ++i) {
    if (i > 0) test_outliers(problem, options, all_chi2(problem));
    last = solve_round(problem, options, options.rounds[i], stop);
    iterations += last.iterations;
    if (last.end != SolveEnd::kConverged && last.end != SolveEnd::kIterationLimit) break;
  }
  last.iterations = iterations;
  return last;
}

}  // namespace

std::string ProblemOptions::validate() const {
  if (rounds.empty()) return "rounds: at least one is needed";
  for (const SolveRound& round : rounds) {
    if (round.iterations < 1) return "rounds: iterations must be positive";
    if (!(round.function_tolerance >= 0)) return "rounds: tolerance must not be negative";
  }
  if (!(chi2_mono > 0) || !(chi2_stereo > 0)) return "chi2 thresholds must be positive";
  if (max_dense_poses < 0) return "max_dense_poses must not be negative";
  if (threads < 1) return "threads must be positive";
  return {};
}

BundleResult solve_bundle(const MapSnapshot& map, const ProblemConfig& config,
                          const std::stop_token& stop) {
  const auto start = std::chrono::steady_clock::now();
  if (const std::string wrong = config.options.validate(); !wrong.empty()) {
    throw std::invalid_argument("ProblemOptions: " + wrong);
  }
  AssembledProblem problem = assemble_problem(map, config);
  const std::vector<double> before = all_chi2(problem);
  drop_unprojectable(problem, before);
  const SolveOutcome outcome = run_rounds(problem, config.options, stop);

  BundleResult result;
  result.summary.end = outcome.end;
  result.summary.text = outcome.text;
  result.summary.iterations = outcome.iterations;
  if (outcome.end != SolveEnd::kFailed && outcome.end != SolveEnd::kEmpty) {
    const std::vector<double> after = all_chi2(problem);
    if (outcome.end != SolveEnd::kStopped) {
      test_outliers(problem, config.options, after);
      for (const ProblemTerm& term : problem.terms) {
        if (!term.active) result.outliers.push_back({term.landmark, term.observation});
      }
    }
    write_estimate(config, problem, result);
    write_costs(problem, before, after, result.summary);
  }
  result.summary.variable_poses = static_cast<int>(result.cam_from_world.size());
  result.summary.variable_landmarks = static_cast<int>(result.point_in_world.size());
  result.summary.outliers = static_cast<int>(result.outliers.size());
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  result.summary.seconds = elapsed.count();
  return result;
}

}  // namespace hybrid_slam
