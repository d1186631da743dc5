// What long runs cost: time by frame and by keyframe as the map grows, memory while it need not.
#include <algorithm>
#include <catch2/catch.hpp>
#include <string_view>
#include <vector>

#include "test/integration/simulated_runs.h"

namespace hybrid_slam {
namespace {

std::vector<double> stage(const RunResult& result, std::string_view name) {
  for (const auto& [stage, durations] : result.times.stages()) {
    if (stage == name) return durations.kept();
  }
  return {};
}

double median(std::vector<double> values) {
  REQUIRE_FALSE(values.empty());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Around a keyframe, of those that came in order.
double median_around(const std::vector<double>& values, std::size_t middle, std::size_t half) {
  const std::size_t from = middle < half ? 0 : middle - half;
  const std::size_t to = std::min(values.size(), middle + half);
  REQUIRE(from < to);
  return median({values.begin() + static_cast<std::ptrdiff_t>(from),
                 values.begin() + static_cast<std::ptrdiff_t>(to)});
}

}  // namespace

TEST_CASE("Tracking and the search for loops cost the same at 200 and at 2000 keyframes",
          "[integration][slow]") {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = 2070;
  options.step = 3;
  options.landmarks = 60000;
  const SimulatedSource source(make_synthetic_scene(options));
  SlamOptions slam = simulated_options();
  slam.features = 400;
  slam.distribute();
  slam.tracking.keyframes.max_frames_between = 1;  // every frame becomes one, and stays
  slam.culling.redundancy.observers = 1000;
  std::stop_source cancel;
  ReplayHooks hooks;
  hooks.cancelled = cancel.get_token();
  std::vector<std::size_t> keyframes_at;  // of the map, by frame
  hooks.progress = [&](const ReplayProgress& progress) {
    keyframes_at.push_back(progress.keyframes);
    if (progress.keyframes >= 2050) cancel.request_stop();
  };
  const RunResult result = run_every_frame(source, slam, simulated_run(source), hooks);
  const auto frame_at = [&](std::size_t keyframes) {
    return static_cast<std::size_t>(
        std::lower_bound(keyframes_at.begin(), keyframes_at.end(), keyframes) -
        keyframes_at.begin());
  };
  const std::vector<double> track = stage(result, "track");
  const std::vector<double> query = stage(result, "find_loop");
  REQUIRE(result.map->keyframe_count() >= 2000);
  const double early = median_around(track, frame_at(200), 50);
  const double late = median_around(track, frame_at(2000), 50);
  const double query_early = median_around(query, 200, 50);
  const double query_late = median_around(query, query.size() - 50, 50);
  std::string growth;
  for (const std::size_t at : {200u, 500u, 1000u, 1500u, 2000u}) {
    growth += std::to_string(median_around(track, frame_at(at), 50)) + ' ';
  }
  WARN("frames " << result.frames.read << " keyframes " << result.map->keyframe_count()
                 << " landmarks " << result.map->landmark_count() << "; track [ms] " << early
                 << " -> " << late << " (" << growth << "), find_loop [ms] " << query_early
                 << " -> " << query_late << ", bytes of map file per keyframe "
                 << bytes_of(*result.map).size() / result.map->keyframe_count());
  CHECK(result.frames.lost == 0);
  CHECK(late <= 1.15 * early);
  CHECK(query_late <= 10);
  for (const LoopRecord& loop : result.loops) CHECK(loop.outcome != kLoopAccepted);
  CHECK(faults_of(*result.map) == "");
}

TEST_CASE("Two thousand frames over mapped ground add few keyframes", "[integration][slow]") {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kHover;
  options.times = 200;
  options.step = 0.005;
  options.noise = 0.15;
  options.clutter = 100;
  SimulatedSource source(make_synthetic_scene(options));
  for (std::size_t i = 0; i < 2000; ++i) {  // there and back again, five times
    const std::size_t phase = i % 400;
    source.order.push_back(phase < 200 ? phase : 399 - phase);
  }
  std::size_t early = 0;
  ReplayHooks hooks;
  hooks.progress = [&](const ReplayProgress& progress) {
    if (progress.done == 400) early = progress.keyframes;
  };
  const RunResult result =
      run_every_frame(source, simulated_options(), simulated_run(source), hooks);
  const std::size_t keyframes = result.map->keyframe_count();
  const std::uint32_t made = result.map->next_keyframe_id().value;
  WARN("keyframes " << early << " after 400 frames, " << keyframes << " after 2000, of " << made
                    << "; landmarks " << result.map->landmark_count()
                    << "; bytes of map file per keyframe "
                    << bytes_of(*result.map).size() / keyframes << "; max error "
                    << max_position_error(result, source));
  CHECK(result.frames.tracked == 2000);
  CHECK(keyframes < 20);
  CHECK(keyframes <= early + 3);
  CHECK(max_position_error(result, source) < 0.02);
  CHECK(faults_of(*result.map) == "");
}

}  // namespace hybrid_slam
