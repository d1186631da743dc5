// What a frame costs as the map grows, feature by feature simulated, every frame a keyframe: wall
// time of one thread, so run it on a machine that does nothing else; and what memory is in use.
//   map_growth [FRAMES [STEP]]
// With a step between frames [m], keyframes are those that the pipeline chooses and keeps.
#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
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

double megabytes_in_use() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}

SlamOptions usual_keyframes() {
  SlamOptions options = simulated_options();
  options.features = 400;
  options.distribute();
  return options;
}

void print_growth(int frames, double step) {
  SyntheticSceneOptions corridor = long_corridor();
  const int times = frames + static_cast<int>(kHalfWindow) + 1;
  const double way = times * (step > 0 ? step : corridor.step);
  corridor.landmarks =
      static_cast<int>(corridor.landmarks * way / (corridor.times * corridor.step));
  corridor.times = times;
  if (step > 0) corridor.step = step;
  const SimulatedSource source(make_synthetic_scene(corridor));
  std::vector<double> memory;  // after each frame
  ReplayHooks hooks;
  hooks.frame = [&](const FrameResult&) { memory.push_back(megabytes_in_use()); };
  const RunResult result = run_every_frame(
      source, step > 0 ? usual_keyframes() : keyframe_each_frame(), simulated_run(source), hooks);
  std::printf("frames %zu, keyframes %zu, landmarks %zu\n",
              static_cast<std::size_t>(result.frames.read), result.map->keyframe_count(),
              result.map->landmark_count());
  std::printf("   frames  track [ms]  find_loop [ms]  in use [MB]\n");
  for (std::size_t at = 500; at < memory.size(); at += 500) {
    std::printf("%9zu  %10.2f  %14.2f  %11.1f\n", at, median_around(stage(result, "track"), at),
                median_around(stage(result, "find_loop"), at), memory[at]);
  }
  std::printf("KB per keyframe over the second half: %.0f\n",
              2000 * (memory.back() - memory[memory.size() / 2]) /
                  static_cast<double>(result.map->keyframe_count()));
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  hybrid_slam::print_growth(argc > 1 ? std::atoi(argv[1]) : 2000,
                            argc > 2 ? std::atof(argv[2]) : 0);
  return 0;
}
