// What long runs look at as the map grows, and what stays while it need not.
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "frontend/tracking/local_map.h"
#include "test/integration/simulated_runs.h"

namespace hybrid_slam {
namespace {

// What a frame at the map's newest keyframe is compared with.
struct Looked {
  double landmarks = 0;
  double observations = 0;  // of the keyframe's landmarks: their keyframes are the local map
};

Looked looked_at(const MapSnapshot& map) {
  const Keyframe& newest = *map.newest_keyframe(map.at(map.origin()).observations->camera);
  Looked looked;
  for (const LandmarkId id : newest.landmarks) {
    const Landmark* const landmark = id.valid() ? map.find(id) : nullptr;
    if (landmark != nullptr) {
      looked.observations += static_cast<double>(landmark->observations.size());
    }
  }
  looked.landmarks =
      static_cast<double>(make_local_map(map, newest.landmarks, {}).landmarks.size());
  return looked;
}

Looked mean(const std::vector<Looked>& of) {
  const auto count = static_cast<double>(of.size());
  Looked mean;
  for (const Looked& one : of) {
    mean.landmarks += one.landmarks / count;
    mean.observations += one.observations / count;
  }
  return mean;
}

}  // namespace

// What it costs in time: test/benchmark/map_growth.
TEST_CASE("Tracking looks at as much of a map of 2000 keyframes as of one of 200",
          "[integration][slow]") {
  const SimulatedSource source(make_synthetic_scene(long_corridor()));
  std::vector<Looked> early;
  std::vector<Looked> late;
  ReplayHooks hooks;
  hooks.map = [&](const std::shared_ptr<const MapSnapshot>& map, MapChange change) {
    const std::size_t keyframes = map->keyframe_count();
    if (change != MapChange::kKeyframe) return;
    if (keyframes > 150 && keyframes <= 250) early.push_back(looked_at(*map));
    if (keyframes > 1950) late.push_back(looked_at(*map));
  };
  const RunResult result =
      run_every_frame(source, keyframe_each_frame(), simulated_run(source), hooks);
  REQUIRE(result.map->keyframe_count() >= 2000);
  REQUIRE(early.size() == 100);
  REQUIRE(late.size() >= 50);
  const Looked then = mean(early);
  const Looked now = mean(late);
  WARN("landmarks " << then.landmarks << " -> " << now.landmarks << ", observations "
                    << then.observations << " -> " << now.observations
                    << ", bytes of map file per keyframe "
                    << bytes_of(*result.map).size() / result.map->keyframe_count());
  CHECK(now.landmarks <= 1.15 * then.landmarks);
  CHECK(now.observations <= 1.15 * then.observations);
  CHECK(result.frames.lost == 0);
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
