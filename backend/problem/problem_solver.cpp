#include "backend/problem/problem_solver.h"

#include <ceres/iteration_callback.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <utility>

#include "backend/problem/bundle_solver.h"
#include "backend/problem/openmp_threads.h"

namespace hybrid_slam {

namespace {

// Frames that vary, up to which the reduced camera system is solved dense, and from which on it is
// no longer formed (test/benchmark/local_bundle_benchmark, docs/benchmarks.md).
constexpr std::size_t kMaxDenseFrames = 60;
constexpr std::size_t kMinIterativeFrames = 20000;

class WatchingCallback final : public ceres::IterationCallback {
 public:
  WatchingCallback(const std::stop_token& stop,
                   const std::function<void(const IterationReport&)>& progress)
      : stop_(stop), progress_(progress) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
    if (progress_) {
      progress_({0, iteration.iteration, iteration.cost, iteration.step_norm,
                 iteration.cumulative_time_in_seconds});
    }
    return stop_.stop_requested() ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const std::stop_token& stop_;
  const std::function<void(const IterationReport&)>& progress_;
};

// Landmarks first, then poses and intrinsics: without it Ceres looks for an independent set by
// itself.
std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order(FactorGraph& graph,
                                                                 CeresGraph& built) {
  const ceres::Problem& problem = *built.problem;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  const auto add = [&](double* block, int group) {
    if (problem.HasParameterBlock(block)) ordering->AddElementToGroup(block, group);
  };
  for (GraphPoint& point : graph.points) add(point.in_world.data(), 0);
  for (GraphFrame& frame : graph.frames) add(frame.cam_from_world.params.data(), 1);
  for (std::vector<double>& frame : built.joint_frames) {
    if (!frame.empty()) add(frame.data(), 1);
  }
  for (GraphSimilarity& vertex : graph.similarities) add(vertex.cam_from_world.params.data(), 1);
  for (GraphCamera& camera : graph.cameras) add(params_of(camera.camera), 1);
  for (GraphBlock& block : graph.blocks) add(block.values.data(), 1);
  return ordering;
}

bool is_finite(const FactorGraph& graph) {
  return std::all_of(graph.frames.begin(), graph.frames.end(),
                     [](const auto& f) { return f.cam_from_world.params.allFinite(); }) &&
         std::all_of(graph.points.begin(), graph.points.end(),
                     [](const auto& p) { return p.in_world.allFinite(); }) &&
         std::all_of(graph.similarities.begin(), graph.similarities.end(),
                     [](const auto& s) { return s.cam_from_world.params.allFinite(); }) &&
         std::all_of(graph.blocks.begin(), graph.blocks.end(),
                     [](const auto& block) { return block.values.allFinite(); });
}

std::size_t varying_frames(const FactorGraph& graph) {
  return static_cast<std::size_t>(std::count_if(graph.frames.begin(), graph.frames.end(),
                                                [](const auto& frame) { return !frame.fixed; }));
}

ceres::LinearSolverType linear_solver_of(const FactorGraph& graph, LinearSolver wanted) {
  const bool bundle = !graph.points.empty();
  if (wanted == LinearSolver::kAuto) {
    const std::size_t frames = varying_frames(graph);
    wanted = LinearSolver::kSparse;
    if (bundle && frames <= kMaxDenseFrames) wanted = LinearSolver::kDense;
    if (bundle && frames >= kMinIterativeFrames) wanted = LinearSolver::kIterative;
  }
  switch (wanted) {
    case LinearSolver::kDense:
      return bundle ? ceres::DENSE_SCHUR : ceres::DENSE_NORMAL_CHOLESKY;
    case LinearSolver::kIterative:
      return bundle ? ceres::ITERATIVE_SCHUR : ceres::CGNR;
    default:
      return bundle ? ceres::SPARSE_SCHUR : ceres::SPARSE_NORMAL_CHOLESKY;
  }
}

ceres::Solver::Options solver_options(FactorGraph& graph, CeresGraph& built,
                                      const ProblemOptions& options, const SolveRound& round) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = linear_solver_of(graph, options.linear_solver);
  if (solver.linear_solver_type == ceres::ITERATIVE_SCHUR) {
    solver.preconditioner_type = ceres::SCHUR_JACOBI;
  }
  if (!graph.points.empty()) solver.linear_solver_ordering = elimination_order(graph, built);
  solver.max_num_iterations = round.iterations;
  solver.function_tolerance = round.function_tolerance;
  solver.initial_trust_region_radius = options.trust_region;
  // Steps that put points behind cameras: each shrinks the radius more than the last one, by 2^k.
  solver.max_num_consecutive_invalid_steps = 12;
  if (options.max_seconds > 0) solver.max_solver_time_in_seconds = options.max_seconds;
  solver.num_threads = options.threads;
  solver.logging_type = ceres::SILENT;
  return solver;
}

SolveEnd end_of(const ceres::Solver::Summary& summary, const ProblemOptions& options) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
      return SolveEnd::kConverged;
    case ceres::NO_CONVERGENCE:
      return options.max_seconds > 0 && summary.total_time_in_seconds >= options.max_seconds
                 ? SolveEnd::kTimeLimit
                 : SolveEnd::kIterationLimit;
    case ceres::USER_SUCCESS:
      return SolveEnd::kStopped;
    default:
      return SolveEnd::kFailed;
  }
}

SolveOutcome solve_with_ceres(FactorGraph& graph, const GraphFactors& factors,
                              const ProblemOptions& options, const SolveRound& round,
                              const std::stop_token& stop,
                              const std::function<void(const IterationReport&)>& progress) {
  SolveOutcome outcome;
  CeresGraph built = build_ceres_problem(graph, factors, options, round.loss);
  if (built.problem->NumResidualBlocks() == 0) {
    outcome.text = kNothingVaries;
    return outcome;
  }
  ceres::Solver::Options solver = solver_options(graph, built, options, round);
  WatchingCallback callback(stop, progress);
  solver.callbacks.push_back(&callback);
  ceres::Solver::Summary summary;
  allow_openmp_threads(options.threads > 1);
  ceres::Solve(solver, built.problem.get(), &summary);
  built.write_back(graph);

  outcome.end = end_of(summary, options);
  outcome.text = outcome.end == SolveEnd::kStopped ? "stopped on request" : summary.message;
  outcome.iterations = std::max(0, static_cast<int>(summary.iterations.size()) - 1);
  outcome.build_seconds = summary.preprocessor_time_in_seconds;
  outcome.residual_seconds = summary.residual_evaluation_time_in_seconds;
  outcome.jacobian_seconds = summary.jacobian_evaluation_time_in_seconds;
  outcome.linear_solver_seconds = summary.linear_solver_time_in_seconds;
  return outcome;
}

}  // namespace

SolveOutcome solve_round(FactorGraph& graph, const GraphFactors& factors,
                         const ProblemOptions& options, const SolveRound& round,
                         const std::stop_token& stop,
                         const std::function<void(const IterationReport&)>& progress) {
  SolveOutcome outcome;
  if (stop.stop_requested()) {
    outcome.end = SolveEnd::kStopped;
    outcome.text = "stopped before the first iteration";
    return outcome;
  }
  if (!is_finite(graph)) {
    outcome.end = SolveEnd::kFailed;
    outcome.text = "initial values are not finite";
    return outcome;
  }
  const bool plain = options.linear_solver == LinearSolver::kAuto && is_plain_bundle(graph) &&
                     varying_frames(graph) < kMinIterativeFrames;
  outcome = plain ? solve_bundle_round(graph, factors, options, round, stop, progress)
                  : solve_with_ceres(graph, factors, options, round, stop, progress);
  if (outcome.end != SolveEnd::kFailed && !is_finite(graph)) {
    outcome.end = SolveEnd::kFailed;
    outcome.text = "the solution is not finite";
  }
  return outcome;
}

}  // namespace hybrid_slam
