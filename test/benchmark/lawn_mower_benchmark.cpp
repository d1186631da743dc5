// Incremental smoothing of a lawn-mower survey: CPU time per update and the solver's memory along
// the way, and how far its cost is from a batch solution's, in all and of the newest keyframes.
//   lawn_mower_benchmark [KEYFRAMES [WINDOW [compare]]]
//   lawn_mower_benchmark KEYFRAMES write FILE     the same as a stereo stream, for peers

#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <numeric>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "backend/problem/solve_graph.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/incremental/lawn_mower.h"

namespace hybrid_slam {
namespace {

double cpu_milliseconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double allocated_megabytes() {
  const struct mallinfo2 info = mallinfo2();
  return 1e-6 * static_cast<double>(info.uordblks + info.hblkhd);
}

// The observations of the newest keyframes alone, with all that they see.
FactorGraph newest(FactorGraph graph, std::size_t keyframes) {
  const std::size_t first = graph.frames.size() - std::min(graph.frames.size(), keyframes);
  std::erase_if(graph.observations, [&](const auto& seen) { return seen.frame < first; });
  return graph;
}

void report_cost(const FactorGraph& graph) {
  constexpr std::size_t kNewest = 1000;
  ProblemOptions options;
  options.rounds = {{50, Loss::kNone, 1e-9}};
  FactorGraph best = graph;
  solve_graph(best, options);
  std::printf("cost %.9g, above batch: %.3g; of the newest %zu keyframes: %.3g\n", cost(graph),
              cost(graph) / cost(best) - 1, kNewest,
              cost(newest(graph, kNewest)) / cost(newest(best, kNewest)) - 1);
}

void append_pose(const char* word, const Rigid3d& pose, std::string& text) {
  text += word;
  for (const int i : {4, 5, 6, 0, 1, 2, 3}) {  // translation, quaternion x y z w
    fmt::format_to(std::back_inserter(text), " {}", pose.params[i]);
  }
}

// As apps/io/graphs/stereo_stream.h says. Starts are off, the first pose excepted.
int write(int keyframes, const char* path) {
  LawnMowerOptions options;
  options.keyframes = keyframes;
  const FactorGraph graph = lawn_mower_graph(options);
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(graph.cameras[0].camera).params;
  std::string text = fmt::format(
      "CAM {} {} {} {} SIGMA_PX {} ODO_SIGMA_ROT 0.003 ODO_SIGMA_T 0.03 NKF {} NLM {} "
      "NOBS {}\n",
      camera[0], camera[2], camera[3], camera[4], graph.observations[0].sigma, graph.frames.size(),
      graph.points.size(), graph.observations.size());
  auto next = graph.observations.begin();
  for (std::uint32_t i = 0; i < graph.frames.size(); ++i) {
    text += fmt::format("KF {}", i);
    append_pose(" GT", inverse(graph.frames[i].cam_from_world), text);
    if (i > 0) {
      append_pose(" ODO",
                  graph.frames[i - 1].cam_from_world * inverse(graph.frames[i].cam_from_world),
                  text);
    }
    const auto end =
        std::find_if(next, graph.observations.end(), [&](const auto& o) { return o.frame != i; });
    text += fmt::format(" N {}\n", end - next);
    for (; next != end; ++next) {
      const Eigen::Vector3d& uv = next->measurement;
      fmt::format_to(std::back_inserter(text), "{} {} {} {}\n", next->point, uv[0], uv[2], uv[1]);
    }
  }
  std::ofstream(path) << text;
  return 0;
}

int run(int keyframes, int window, bool compare) {
  LawnMowerOptions options;
  options.keyframes = keyframes;
  FactorGraph graph = lawn_mower_graph(options);
  std::printf(
      "%zu keyframes, %zu landmarks, %.0f observations per keyframe\n", graph.frames.size(),
      graph.points.size(),
      static_cast<double>(graph.observations.size()) / static_cast<double>(graph.frames.size()));
  IncrementalOptions solver;
  solver.window = window;
  GraphFeed feed(std::move(graph), solver);
  const double before = allocated_megabytes();
  const std::size_t block = std::max<std::size_t>(1, static_cast<std::size_t>(keyframes) / 10);
  std::vector<double> times;
  std::vector<double> memory;  // at the end of each block
  std::size_t relinearized = 0;
  std::size_t moved = 0;
  std::size_t evaluated = 0;
  std::printf("keyframes  mean ms   max ms  solver MB  relinearized  moved  evaluated  pending\n");
  while (!feed.done()) {
    feed.add_next();
    const double start = cpu_milliseconds();
    const UpdateSummary summary = feed.solver().update();
    times.push_back(cpu_milliseconds() - start);
    relinearized += summary.relinearized;
    moved += summary.moved.size();
    evaluated += summary.evaluated;
    if (times.size() % block != 0) continue;
    memory.push_back(allocated_megabytes() - before);
    const auto first = times.end() - static_cast<std::ptrdiff_t>(block);
    std::printf("%9zu %8.2f %8.2f %10.1f %13zu %6zu %10zu %8zu\n", times.size(),
                std::accumulate(first, times.end(), 0.0) / static_cast<double>(block),
                *std::max_element(first, times.end()), memory.back(), relinearized / block,
                moved / block, evaluated / block, summary.pending);
    std::fflush(stdout);
    relinearized = moved = evaluated = 0;
  }
  std::printf("KB per keyframe over the second half: %.1f\n",
              (memory.back() - memory[memory.size() / 2 - 1]) * 2000 / keyframes);
  std::fflush(stdout);
  if (compare) report_cost(feed.solver().graph());
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  const int keyframes = argc > 1 ? std::atoi(argv[1]) : 1000;
  if (argc == 4 && std::string(argv[2]) == "write") return hybrid_slam::write(keyframes, argv[3]);
  const int window = argc > 2 ? std::atoi(argv[2]) : 0;
  return hybrid_slam::run(keyframes, window, argc > 3);
}
