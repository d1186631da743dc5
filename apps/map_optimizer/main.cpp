#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "apps/io/report.h"
#include "apps/map_optimizer/outputs.h"
#include "apps/program/program.h"
#include "backend/problem/solver_log.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

// Frame by frame, with a line per update.
void solve_incrementally(const CommandLine& line, const GraphFile& file, FactorGraph& problem,
                         OptimizerResult& result) {
  std::stop_source stop;
  const auto progress = [&](const UpdateRecord& update) {
    if (interrupted()) stop.request_stop();
    if (line.quiet) return;
    fmt::print(stderr, "poses {:5}  cost {:<18.10g} {:.3f} ms\n", update.poses, update.cost,
               update.wall_ms);
  };
  IncrementalRun run =
      run_incremental(file, incremental_options(line.options), stop.get_token(), progress, problem);
  result.updates = std::move(run.updates);
  result.solve = summary_of(run, problem);
}

// The solver, with a line per iteration, until it ends or the user asks for it.
void solve(const CommandLine& line, OptimizerProblem& problem, OptimizerResult& result) {
  std::stop_source stop;
  const auto progress = [&](const IterationReport& report) {
    if (interrupted()) stop.request_stop();
    if (line.quiet) return;
    fmt::print(stderr, "iteration {:3}  cost {:<18.10g} step {:<10.3g} {:.2f} s\n",
               report.iteration, report.cost, report.step_norm, report.seconds);
  };
  if (is_pose_graph(problem.graph) && loss_of(line.options) == Loss::kNone) {
    const PoseGraphSummary pose_graph = solve_pose_graph(
        problem.graph, pose_graph_options(line.options), stop.get_token(), progress);
    result.start = pose_graph.start;
    result.solve = pose_graph.summary;
  } else {
    result.start = choose_start(line.options, problem.graph);
    result.solve = solve_graph(problem.graph, problem.options, stop.get_token(), progress);
  }
}

// What --problem incremental cannot do.
void warn_of_limits(const OptimizerOptions& options, const FactorGraph& graph) {
  const bool refines = std::any_of(graph.cameras.begin(), graph.cameras.end(),
                                   [](const GraphCamera& camera) { return camera.refined != 0; });
  if (refines && !options.fix_intrinsics) {
    spdlog::warn("incremental: the intrinsics are kept as they are");
  }
}

// Only the estimate goes back to the file's graph: what a problem fixes or leaves out is its own.
void take_estimate(const OptimizerProblem& problem, FactorGraph& to) {
  const FactorGraph& from = problem.graph;
  for (std::size_t i = 0; i < from.frames.size(); ++i) {
    to.frames[problem.frames[i]].cam_from_world = from.frames[i].cam_from_world;
  }
  for (std::size_t i = 0; i < from.points.size(); ++i) {
    to.points[problem.points[i]].in_world = from.points[i].in_world;
  }
  for (std::size_t i = 0; i < to.cameras.size(); ++i) {
    to.cameras[i].camera = from.cameras[i].camera;
  }
  for (std::size_t i = 0; i < to.blocks.size(); ++i) to.blocks[i].values = from.blocks[i].values;
}

OptimizerResult optimize(const CommandLine& line, const GraphFile& file, PhaseTimes& times) {
  OptimizerResult result;
  result.graph = file.graph;
  result.problem = make_problem(file, line.options, line.input);
  times.end("build");
  if (line.options.problem == ProblemKind::kIncremental) {
    solve_incrementally(line, file, result.problem.graph, result);
  } else {
    solve(line, result.problem, result);
  }
  if (result.solve.end != SolveEnd::kFailed) take_estimate(result.problem, result.graph);
  times.end("solve");
  result.initial_cost = cost(file.graph);
  result.final_cost = cost(result.graph);
  result.initial_errors = reprojection_errors(file.graph);
  result.final_errors = reprojection_errors(result.graph);
  times.end("evaluate");
  return result;
}

int exit_code_of(const GraphSummary& solve) {
  switch (solve.end) {
    case SolveEnd::kEmpty:
    case SolveEnd::kFailed:
      spdlog::error("{}: {}", to_string(solve.end), solve.text);
      return kExitNoSolution;
    case SolveEnd::kStopped:
      spdlog::warn("interrupted: the estimate so far is saved");
      return kExitInterrupted;
    default:
      return kExitOk;
  }
}

int run(const CommandLine& line) {
  PhaseTimes times;
  const GraphFile file = read_graph(line.input);
  find_writer(line, file);  // before the work, not after: can the results be written?
  write_file(make_folder(line.out) / "report.json", "{}\n");
  for (const std::string& warning : file.warnings) spdlog::warn(warning);
  if (!line.quiet) {
    spdlog::info("{} ({}): {} frames, {} points, {} observations, {} edges", line.input,
                 name_of(file.format), file.graph.frames.size(), file.graph.points.size(),
                 file.graph.observations.size(), file.graph.edges.size());
  }
  if (line.options.problem == ProblemKind::kIncremental) warn_of_limits(line.options, file.graph);
  times.end("read");
  const OptimizerResult result = optimize(line, file, times);
  write_graph(line, file, result);
  times.end("write");
  write_report(line, file, result, times);
  if (!line.quiet) {
    spdlog::info("cost {:.10g} -> {:.10g} in {} iterations: {}", result.initial_cost,
                 result.final_cost, result.solve.iterations, to_string(result.solve.end));
  }
  return exit_code_of(result.solve);
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("map_optimizer", [&]() -> int {
    silence_solver_log();
    int exit_code = kExitOk;
    const auto line = parse_command_line(argc, argv, exit_code);
    if (!line) return exit_code;
    watch_signals();
    return run(*line);
  });
}
