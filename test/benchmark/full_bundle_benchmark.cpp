// Full bundle adjustment by the bundle solver and by Ceres: iterations, costs, CPU time and memory.
//   full_bundle_benchmark MAP.hslam      a map, as after a loop: two rounds
//   full_bundle_benchmark KEYFRAMES [OBSERVATIONS_PER_KEYFRAME]   a simulated survey, one round
// Each solve runs in a process of its own, so that none finds the memory of the one before.

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "backend/map/map_file.h"
#include "backend/problem/full_bundle.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/solve_graph.h"
#include "test/backend/incremental/lawn_mower.h"

namespace hybrid_slam {
namespace {

struct Task {
  FactorGraph graph;
  ProblemOptions options;
};

Task task_of(int argc, char** argv) {
  if (std::filesystem::exists(argv[1])) {
    const LoadedMap loaded = load_map(argv[1]);
    FullBundleOptions all;
    all.max_keyframes = loaded.map.view().keyframe_count();
    const ProblemConfig config = make_full_bundle(loaded.map.view(), all);
    return {make_graph(loaded.map.view(), config).graph, config.options};
  }
  LawnMowerOptions options;
  options.keyframes = std::max(2, std::atoi(argv[1]));
  if (argc > 2) options.observations_per_keyframe = std::atof(argv[2]);
  Task task{lawn_mower_graph(options), {}};
  task.options.rounds = {{10, Loss::kHuber, 1e-9}};
  return task;
}

struct Usage {
  double cpu_seconds;
  double peak_megabytes;
};

Usage usage() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return {seconds(used.ru_utime) + seconds(used.ru_stime),
          static_cast<double>(used.ru_maxrss) / 1024};
}

void solve_and_print(const char* name, LinearSolver solver, Task& task) {
  task.options.linear_solver = solver;
  const Usage before = usage();
  const GraphSummary summary = solve_graph(task.graph, task.options);
  const Usage after = usage();
  std::printf("| %s | %d | %.9g | %.9g | %.3f | %.3f | %.0f |\n", name, summary.iterations,
              summary.initial_cost, summary.final_cost, after.cpu_seconds - before.cpu_seconds,
              (after.cpu_seconds - before.cpu_seconds) / std::max(1, summary.iterations),
              after.peak_megabytes);
}

void in_child(const char* name, LinearSolver solver, Task& task) {
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    solve_and_print(name, solver, task);
    std::fflush(stdout);
    _exit(0);
  }
  waitpid(child, nullptr, 0);
}

int run(int argc, char** argv) {
  if (argc < 2) {
    std::fputs("full_bundle_benchmark MAP.hslam | KEYFRAMES [OBSERVATIONS_PER_KEYFRAME]\n", stderr);
    return 2;
  }
  Task task = task_of(argc, argv);
  std::printf("%zu frames, %zu points, %zu observations, %zu edges; %.0f MB before\n",
              task.graph.frames.size(), task.graph.points.size(), task.graph.observations.size(),
              task.graph.edges.size(), usage().peak_megabytes);
  std::printf("| solver | iterations | cost before | after | CPU s | per iteration | peak MB |\n");
  in_child("ours", LinearSolver::kAuto, task);
  if (task.graph.frames.size() <= 400) in_child("Ceres, dense", LinearSolver::kDense, task);
  in_child("Ceres, sparse", LinearSolver::kSparse, task);
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) { return hybrid_slam::run(argc, argv); }
