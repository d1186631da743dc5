// A vehicle that is lost and sees no place that it knows maps on in another component, which is
// joined with the first one when it comes back.
#include <catch2/catch.hpp>

#include "backend/map/components.h"
#include "test/integration/simulated_runs.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kDark = 15;  // 1.5 s: longer than constant velocity is believed

// A third of a lap, dark, then from half of the lap on until `last`.
SimulatedSource interrupted_lap(std::size_t last, std::uint64_t seed) {
  SyntheticSceneOptions options = orbit_of(2 * kOrbitFrames);
  options.seed = seed;
  SimulatedSource source(make_synthetic_scene(options));
  for (std::size_t i = 0; i < 20; ++i) source.order.push_back(i);
  for (std::size_t i = 0; i < kDark; ++i) {
    source.blank.insert(source.order.size());
    source.order.push_back(20);
  }
  for (std::size_t i = 30; i < last; ++i) source.order.push_back(i);
  return source;
}

RunResult run(const SimulatedSource& source, bool realtime) {
  return (realtime ? run_realtime : run_every_frame)(source, simulated_options(),
                                                     simulated_run(source), {}, {});
}

// Of the frames from `begin` on that have poses in the component of most frames; their world is the
// first one's camera.
double worst_error(const RunResult& result, const SimulatedSource& source, std::size_t begin = 0) {
  const FrameRecord* first = nullptr;
  double worst = 0;
  for (std::size_t i = 0; i < result.records.size(); ++i) {
    const FrameRecord& record = result.records[i];
    if (!record.in_main) continue;
    if (first == nullptr) first = &record;
    if (i < begin) continue;
    const auto truth = [&](const FrameRecord& one) {
      return source.stereo_truth(static_cast<std::size_t>(one.frame.frame_index)).cam_from_world;
    };
    const Rigid3d estimated =
        result.cam_from_world(*first) * inverse(result.cam_from_world(record));
    const Rigid3d expected = truth(*first) * inverse(truth(record));
    worst = std::max(worst, (estimated.translation() - expected.translation()).norm());
  }
  return worst;
}

}  // namespace

TEST_CASE("Lost in unknown ground, the map goes on in another component", "[integration]") {
  const SimulatedSource source = interrupted_lap(45, 1);
  for (const bool realtime : {false, true}) {
    const RunResult result = run(source, realtime);
    // In realtime the last keyframe may still be on its way when the light comes back.
    const int late = result.frames.lost + result.frames.coasted - static_cast<int>(kDark);
    CHECK(late >= 0);
    CHECK(late <= (realtime ? 2 : 0));
    CHECK(result.components == 2);
    CHECK(result.frames.tracked == 20);
    CHECK(result.frames.other_components == 15 - late);
    CHECK(result.records[20 + kDark + static_cast<std::size_t>(late)].frame.source ==
          PoseSource::kInitialization);
    CHECK(worst_error(result, source) < 0.1);  // an open track of 6 m
    CHECK(faults_of(*result.map) == "");
    // It is still two when it is read from a file.
    CHECK(component_sizes(copy_of(*result.map).view()) == component_sizes(*result.map));
  }
}

TEST_CASE("Components are joined when the vehicle comes back", "[integration]") {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const SimulatedSource source = interrupted_lap(kOrbitFrames + 18, seed);
    for (const bool realtime : {false, true}) {
      INFO("seed " << seed << (realtime ? ", realtime" : ", every frame"));
      const RunResult result = run(source, realtime);
      CHECK(result.components == 1);
      const int late = result.frames.lost + result.frames.coasted - static_cast<int>(kDark);
      CHECK(late >= 0);
      CHECK(late <= (realtime ? 2 : 0));
      CHECK(result.frames.other_components == 0);
      CHECK(result.frames.tracked == static_cast<int>(source.size() - kDark) - late);
      // Back over known ground; the far end of the part in between drifts as an open track does.
      CHECK(worst_error(result, source, source.size() - 10) < 0.05);
      CHECK(worst_error(result, source) < 0.5);
      CHECK(faults_of(*result.map) == "");
    }
  }
}

}  // namespace hybrid_slam
