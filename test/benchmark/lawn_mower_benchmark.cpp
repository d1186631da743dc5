// Incremental smoothing of a lawn-mower survey, as long as --keyframes says: CPU time per update
// and the solver's memory along the way, and how far its cost is from a batch solution's.

#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numeric>
#include <vector>

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
  std::size_t relinearized = 0;
  std::size_t moved = 0;
  std::printf("keyframes  mean ms   max ms  solver MB  relinearized  moved  pending\n");
  while (!feed.done()) {
    feed.add_next();
    const double start = cpu_milliseconds();
    const UpdateSummary summary = feed.solver().update();
    times.push_back(cpu_milliseconds() - start);
    relinearized += summary.relinearized;
    moved += summary.moved.size();
    if (times.size() % block != 0) continue;
    const auto first = times.end() - static_cast<std::ptrdiff_t>(block);
    std::printf("%9zu %8.2f %8.2f %10.1f %13zu %6zu %8zu\n", times.size(),
                std::accumulate(first, times.end(), 0.0) / static_cast<double>(block),
                *std::max_element(first, times.end()), allocated_megabytes() - before,
                relinearized / block, moved / block, summary.pending);
    std::fflush(stdout);
    relinearized = moved = 0;
  }
  if (compare) std::printf("cost above batch: %.3g\n", excess(feed.solver()));
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  const int keyframes = argc > 1 ? std::atoi(argv[1]) : 1000;
  const int window = argc > 2 ? std::atoi(argv[2]) : 0;
  return hybrid_slam::run(keyframes, window, argc > 3);
}
