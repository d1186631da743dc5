// Incremental smoothing along a corridor: CPU time per update around 200 keyframes and around
// 2,000, in one run, and their ratio: 1 if it does not depend on the size of the map.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <vector>

#include "test/backend/incremental/corridor.h"
#include "test/backend/incremental/graph_feed.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kEarly = 200;
constexpr std::size_t kLate = 2000;
constexpr std::size_t kHalfWidth = 50;

double cpu_milliseconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double mean_around(const std::vector<double>& values, std::size_t centre) {
  double sum = 0;
  for (std::size_t i = centre - kHalfWidth; i < centre + kHalfWidth; ++i) sum += values[i];
  return sum / (2 * kHalfWidth);
}

void corridor(benchmark::State& state) {
  const FactorGraph graph = corridor_graph(static_cast<int>(kLate + kHalfWidth), 20);
  std::vector<double> milliseconds;
  for (auto _ : state) {
    milliseconds.clear();
    GraphFeed feed(graph, {});
    while (!feed.done()) {
      const double start = cpu_milliseconds();
      feed.feed_next();
      milliseconds.push_back(cpu_milliseconds() - start);
    }
  }
  state.counters["observations_per_keyframe"] =
      static_cast<double>(graph.observations.size()) / static_cast<double>(graph.frames.size());
  state.counters["ms_at_200"] = mean_around(milliseconds, kEarly);
  state.counters["ms_at_2000"] = mean_around(milliseconds, kLate);
  state.counters["ms_worst"] = *std::max_element(milliseconds.begin(), milliseconds.end());
  state.counters["ratio"] = state.counters["ms_at_2000"] / state.counters["ms_at_200"];
}

BENCHMARK(corridor)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace hybrid_slam
