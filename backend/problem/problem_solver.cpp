#include "backend/problem/problem_solver.h"

#include <ceres/iteration_callback.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>

namespace hybrid_slam {

namespace {

class StopCallback final : public ceres::IterationCallback {
 public:
  explicit StopCallback(const std::stop_token& stop) : stop_(stop) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return stop_.stop_requested() ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const std::stop_token& stop_;
};

// Landmarks first, then poses: without it Ceres looks for an independent set by itself.
std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order(AssembledProblem& assembled,
                                                                 const ceres::Problem& problem) {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (Eigen::Vector3d& point : assembled.points) {
    if (problem.HasParameterBlock(point.data())) ordering->AddElementToGroup(point.data(), 0);
  }
  for (Rigid3d& pose : assembled.poses) {
    double* block = pose.params.data();
    if (problem.HasParameterBlock(block)) ordering->AddElementToGroup(block, 1);
  }
  return ordering;
}

bool is_finite(const AssembledProblem& problem) {
  const auto finite_pose = [](const Rigid3d& pose) { return pose.params.allFinite(); };
  const auto finite_point = [](const Eigen::Vector3d& point) { return point.allFinite(); };
  return std::all_of(problem.poses.begin(), problem.poses.end(), finite_pose) &&
         std::all_of(problem.points.begin(), problem.points.end(), finite_point);
}

bool has_active_terms(const AssembledProblem& problem) {
  return std::any_of(problem.terms.begin(), problem.terms.end(),
                     [](const ProblemTerm& term) { return term.active; });
}

ceres::Solver::Options solver_options(AssembledProblem& assembled, const ceres::Problem& problem,
                                      const ProblemOptions& options, const SolveRound& round) {
  ceres::Solver::Options solver;
  const bool dense = assembled.variable_poses <= static_cast<std::size_t>(options.max_dense_poses);
  solver.linear_solver_type = dense ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering = elimination_order(assembled, problem);
  solver.max_num_iterations = round.iterations;
  solver.function_tolerance = round.function_tolerance;
  solver.num_threads = options.threads;
  solver.logging_type = ceres::SILENT;
  return solver;
}

SolveEnd end_of(const ceres::Solver::Summary& summary) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
      return SolveEnd::kConverged;
    case ceres::NO_CONVERGENCE:
      return SolveEnd::kIterationLimit;
    case ceres::USER_SUCCESS:
      return SolveEnd::kStopped;
    default:
      return SolveEnd::kFailed;
  }
}

}  // namespace

SolveOutcome solve_round(AssembledProblem& assembled, const ProblemOptions& options,
                         const SolveRound& round, const std::stop_token& stop) {
  if (stop.stop_requested()) return {SolveEnd::kStopped, "stopped before the first iteration", 0};
  if (!is_finite(assembled)) return {SolveEnd::kFailed, "initial values are not finite", 0};
  if (!has_active_terms(assembled)) return {SolveEnd::kEmpty, "no observations", 0};
  const auto problem = build_ceres_problem(assembled, options, round.robust);
  ceres::Solver::Options solver = solver_options(assembled, *problem, options, round);
  StopCallback callback(stop);
  solver.callbacks.push_back(&callback);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, problem.get(), &summary);

  SolveOutcome outcome{end_of(summary), summary.message, 0};
  outcome.iterations = static_cast<int>(summary.iterations.size()) - 1;
  if (outcome.end == SolveEnd::kStopped) outcome.text = "stopped on request";
  if (outcome.end != SolveEnd::kFailed && !is_finite(assembled)) {
    outcome.end = SolveEnd::kFailed;
    outcome.text = "the solution is not finite";
  }
  return outcome;
}

}  // namespace hybrid_slam
