// What a frame costs as the map grows, feature by feature simulated, every frame a keyframe: wall
// time of one thread, so run it on a machine that does nothing else.

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <vector>

#include "test/integration/simulated_runs.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kHalfWindow = 50;  // frames before and after the one that is asked for

const std::vector<double>& stage(const RunResult& result, std::string_view name) {
  static const std::vector<double> kNone;
  for (const auto& [stage, durations] : result.times.stages()) {
    if (stage == name) return durations.kept();
  }
  return kNone;
}

double median_around(const std::vector<double>& values, std::size_t middle) {
  const auto from = std::min(values.size(), middle - kHalfWindow);
  const auto to = std::min(values.size(), middle + kHalfWindow);
  std::vector<double> window(values.begin() + static_cast<std::ptrdiff_t>(from),
                             values.begin() + static_cast<std::ptrdiff_t>(to));
  if (window.empty()) return 0;
  std::sort(window.begin(), window.end());
  return window[window.size() / 2];
}

void print_growth() {
  const SimulatedSource source(make_synthetic_scene(long_corridor()));
  const RunResult result =
      run_every_frame(source, keyframe_each_frame(), simulated_run(source), {});
  std::printf("frames %zu, keyframes %zu, landmarks %zu\nkeyframes  track [ms]  find_loop [ms]\n",
              static_cast<std::size_t>(result.frames.read), result.map->keyframe_count(),
              result.map->landmark_count());
  for (const std::size_t at : {200u, 500u, 1000u, 1500u, 2000u}) {
    std::printf("%9zu  %10.2f  %14.2f\n", at, median_around(stage(result, "track"), at),
                median_around(stage(result, "find_loop"), at));
  }
}

}  // namespace
}  // namespace hybrid_slam

int main() {
  hybrid_slam::print_growth();
  return 0;
}
