#include "apps/map_optimizer/outputs.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "apps/io/report.h"
#include "apps/io/trajectory.h"
#include "apps/slam/version.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

const char* name_of(ProblemKind kind) {
  switch (kind) {
    case ProblemKind::kFull:
      return "full";
    case ProblemKind::kLoop:
      return "loop";
    case ProblemKind::kLocal:
      return "local";
    case ProblemKind::kIncremental:
      return "incremental";
  }
  throw std::logic_error("no such kind of problem");
}

const char* name_of(Loss loss) {
  switch (loss) {
    case Loss::kNone:
      return "none";
    case Loss::kHuber:
      return "huber";
    case Loss::kCauchy:
      return "cauchy";
  }
  throw std::logic_error("no such loss");
}

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

Trajectory trajectory_of(const std::vector<double>& times, const FactorGraph& graph) {
  Trajectory trajectory;
  for (std::size_t i = 0; i < times.size(); ++i) {
    trajectory.push_back({times[i], inverse(graph.frames[i].cam_from_world)});
  }
  return trajectory;
}

Json ate_json(const GraphFile& file, const FactorGraph& graph) {
  if (file.times.empty() || file.true_cam_from_world.empty()) return {};
  Trajectory truth;
  for (std::size_t i = 0; i < file.times.size(); ++i) {
    truth.push_back({file.times[i], inverse(file.true_cam_from_world[i])});
  }
  constexpr double kSameTime = 1e-6;  // [s]
  const auto ate = absolute_error(associate(trajectory_of(file.times, graph), truth, kSameTime),
                                  TrajectoryAlignment::kSe3);
  return ate ? to_json(*ate) : Json();
}

Json counts_json(const FactorGraph& graph) {
  const auto fixed = std::count_if(graph.frames.begin(), graph.frames.end(),
                                   [](const GraphFrame& frame) { return frame.fixed; });
  return {{"cameras", graph.cameras.size()},
          {"frames", graph.frames.size()},
          {"fixed_frames", fixed},
          {"points", graph.points.size()},
          {"observations", graph.observations.size()},
          {"edges", graph.edges.size()}};
}

Json errors_json(const OptimizerResult& result) {
  Json json = Json::object();
  for (const auto& [model, error] : result.final_errors) {
    json[model] = {{"initial", result.initial_errors.at(model).rmse},
                   {"final", error.rmse},
                   {"observations", error.observations}};
  }
  return json;
}

Json observations_json(const GraphFile& file, const OptimizerProblem& problem,
                       const std::vector<std::uint32_t>& indices) {
  Json json = Json::array();
  for (const std::uint32_t index : indices) {
    const GraphObservation& observation = problem.graph.observations[index];
    const auto squared = squared_error(problem.graph, observation);
    json.push_back({{"frame", file.frame_names[problem.frames[observation.frame]]},
                    {"point", file.point_ids[problem.points[observation.point]]},
                    {"error_px", squared ? Json(std::sqrt(*squared)) : Json()}});
  }
  return json;
}

// The loss, or those of the rounds of a map.
Json robust_json(const OptimizerProblem& problem, const OptimizerOptions& options) {
  if (problem.options.rounds.size() == 1) return name_of(loss_of(options));
  Json json = Json::array();
  for (const SolveRound& round : problem.options.rounds) json.push_back(name_of(round.loss));
  return json;
}

Json times_json(const PhaseTimes& times, double PhaseTimes::Phase::*which) {
  Json json = Json::object();
  double sum = 0;
  for (const PhaseTimes::Phase& phase : times.phases()) {
    json[phase.name] = phase.*which;
    sum += phase.*which;
  }
  json["total"] = sum;
  return json;
}

// updates.csv, and what the report says of it.
void write_updates(const fs::path& path, const std::vector<UpdateRecord>& updates) {
  std::string text = "update,poses,cpu_ms,wall_ms,cost\n";
  for (std::size_t i = 0; i < updates.size(); ++i) {
    const UpdateRecord& u = updates[i];
    fmt::format_to(std::back_inserter(text), "{},{},{:.3f},{:.3f},{}\n", i, u.poses, u.cpu_ms,
                   u.wall_ms, u.cost);
  }
  write_file(path, text);
}

Json updates_json(const std::vector<UpdateRecord>& updates) {
  Json json;
  json["count"] = updates.size();
  const auto add = [&](const std::string& name, double UpdateRecord::*which) {
    double sum = 0;
    double most = 0;
    for (const UpdateRecord& update : updates) {
      sum += update.*which;
      most = std::max(most, update.*which);
    }
    json["mean_" + name] = sum / static_cast<double>(updates.size());
    json["max_" + name] = most;
  };
  add("cpu_ms", &UpdateRecord::cpu_ms);
  add("wall_ms", &UpdateRecord::wall_ms);
  return json;
}

Json solver_json(const GraphSummary& solve) {
  return {{"preprocessing", solve.build_seconds},
          {"residuals", solve.residual_seconds},
          {"jacobians", solve.jacobian_seconds},
          {"linear_solver", solve.linear_solver_seconds}};
}

}  // namespace

std::string to_string(SolveEnd end) {
  switch (end) {
    case SolveEnd::kConverged:
      return "converged";
    case SolveEnd::kIterationLimit:
      return "iteration limit";
    case SolveEnd::kStopped:
      return "stopped";
    case SolveEnd::kTimeLimit:
      return "time limit";
    case SolveEnd::kEmpty:
      return "nothing to optimise";
    case SolveEnd::kFailed:
      return "failed";
  }
  throw std::logic_error("no such end");
}

void PhaseTimes::end(const std::string& name) {
  const auto now = std::chrono::steady_clock::now();
  const std::clock_t cpu_now = std::clock();
  phases_.push_back({name, std::chrono::duration<double>(now - start_).count(),
                     static_cast<double>(cpu_now - cpu_start_) / CLOCKS_PER_SEC});
  start_ = now;
  cpu_start_ = cpu_now;
}

const GraphWriter& find_writer(const CommandLine& line, const GraphFile& file) {
  for (const GraphWriter& writer : file.writers) {
    if (writer.format == line.format.value_or(file.format)) return writer;
  }
  std::string possible;
  for (const GraphWriter& writer : file.writers) {
    possible += (possible.empty() ? "" : " or ") + std::string(name_of(writer.format));
  }
  throw InputError(line.input + ": cannot be written as " + std::string(name_of(*line.format)) +
                   ", only as " + possible);
}

void write_graph(const CommandLine& line, const GraphFile& file, const OptimizerResult& result) {
  find_writer(line, file).write(result.graph, line.out);
  if (!file.times.empty()) {
    write_tum(fs::path(line.out) / "optimized.tum", trajectory_of(file.times, result.graph));
  }
  if (!result.updates.empty()) write_updates(fs::path(line.out) / "updates.csv", result.updates);
}

void write_report(const CommandLine& line, const GraphFile& file, const OptimizerResult& result,
                  const PhaseTimes& times) {
  const GraphSummary& solve = result.solve;
  Json json;
  json["input"] = line.input;
  json["format"] = name_of(file.format);
  json["problem"] = name_of(line.options.problem);
  json["robust"] = robust_json(result.problem, line.options);
  json["fixed_intrinsics"] = line.options.fix_intrinsics;
  json["threads"] = line.options.threads;
  json["counts"] = counts_json(result.graph);
  if (!result.problem.graph.edges.empty()) json["start"] = name_of(result.start);
  json["initial_cost"] = result.initial_cost;
  json["final_cost"] = result.final_cost;
  json["reprojection_rmse_px"] = errors_json(result);
  json["ate"] = ate_json(file, result.graph);
  if (!result.updates.empty()) json["updates"] = updates_json(result.updates);
  json["iterations"] = solve.iterations;
  json["termination"] = {{"end", to_string(solve.end)}, {"text", solve.text}};
  json["outliers"] = observations_json(file, result.problem, solve.outliers);
  json["unprojectable"] = observations_json(file, result.problem, solve.unprojectable);
  json["seconds"] = times_json(times, &PhaseTimes::Phase::seconds);
  json["cpu_seconds"] = times_json(times, &PhaseTimes::Phase::cpu_seconds);
  json["solver_seconds"] = solver_json(solve);
  json["peak_memory_mb"] = peak_memory_mb();
  json["blas"] = blas_name();
  json["git_commit"] = kGitCommit;
  write_json(fs::path(line.out) / "report.json", json);
}

}  // namespace hybrid_slam
