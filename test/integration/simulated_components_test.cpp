// A vehicle that is lost and sees no place that it knows maps on in another component, which is
// joined with the first one when it comes back.
#include <algorithm>

#include <catch2/catch.hpp>

#include "apps/view/live_frame.h"
#include "backend/map/components.h"
#include "test/integration/simulated_runs.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kDark = 15;  // 1.5 s: longer than constant velocity is believed

struct Gap {
  std::size_t begin = 20;  // frames of the lap before it
  std::size_t dark = kDark;
  std::size_t end = 30;  // where on the lap it is light again
};

// A part of a lap, dark, then from elsewhere on the lap on until `last`.
SimulatedSource interrupted_lap(std::size_t last, std::uint64_t seed, const Gap& gap = {}) {
  SyntheticSceneOptions options = orbit_of(2 * kOrbitFrames);
  options.seed = seed;
  SimulatedSource source(make_synthetic_scene(options));
  for (std::size_t i = 0; i < gap.begin; ++i) source.order.push_back(i);
  for (std::size_t i = 0; i < gap.dark; ++i) {
    source.blank.insert(source.order.size());
    source.order.push_back(gap.begin);
  }
  for (std::size_t i = gap.end; i < last; ++i) source.order.push_back(i);
  return source;
}

RunResult run(const SimulatedSource& source, bool realtime, const ReplayHooks& hooks = {}) {
  return (realtime ? run_realtime : run_every_frame)(source, simulated_options(),
                                                     simulated_run(source), hooks, {});
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

long joining_loops(const RunResult& result) {
  return std::count_if(result.loops.begin(), result.loops.end(), [](const LoopRecord& loop) {
    return loop.joins && loop.outcome == kLoopAccepted;
  });
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
    CHECK(joining_loops(result) == 0);
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
      CHECK(joining_loops(result) == 1);
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

TEST_CASE("Who watches sees a component that was joined where the results have it",
          "[integration]") {
  const SimulatedSource source = interrupted_lap(kOrbitFrames + 18, 1);
  for (const bool realtime : {false, true}) {
    std::vector<LiveFrame> told;
    ReplayHooks hooks;
    hooks.frame = [&](const FrameResult& frame) { told.push_back(live_frame(frame)); };
    hooks.keyframe = [&](const KeyframeResult& keyframe) { became_keyframe(keyframe, told); };
    const RunResult result = run(source, realtime, hooks);
    REQUIRE(joining_loops(result) == 1);
    const RunStory story = live_story(told, result.map.get());
    REQUIRE(story.frames.size() == result.records.size());
    for (std::size_t i = 0; i < result.records.size(); ++i) {
      if (!result.records[i].frame.tracked()) continue;
      const Rigid3d expected = inverse(result.cam_from_world(result.records[i]));
      INFO("frame " << i << (realtime ? ", realtime" : ", every frame"));
      REQUIRE(story.frames[i].world_from_cam);
      const Rigid3d& shown = *story.frames[i].world_from_cam;
      CHECK((shown.translation() - expected.translation()).norm() < 1e-9);
      CHECK(shown.rotation().angularDistance(expected.rotation()) < 1e-7);
    }
  }
}

TEST_CASE("Of twenty gaps all are joined, and none before the places meet", "[integration][slow]") {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    Gap gap;
    gap.begin = 12 + random.bits() % 6;
    gap.dark = kDark + random.bits() % 30;          // 1.5 to 4.5 s
    gap.end = gap.begin + 16 + random.bits() % 10;  // 5 to 8 m further on
    INFO("seed " << seed << ": " << gap.begin << " frames, dark " << gap.dark << ", on from "
                 << gap.end);
    // A view is 3.2 m long: at 0.31 m per frame the end of the lap shares 30 % with its beginning
    // from 7 frames before it on. 2 s later is 13 frames behind it.
    const SimulatedSource back = interrupted_lap(kOrbitFrames + 13, 100 + seed, gap);
    const RunResult joined = run(back, false);
    CHECK(joined.components == 1);
    CHECK(joined.frames.other_components == 0);
    CHECK(joined.frames.tracked == static_cast<int>(back.size() - gap.dark));
    CHECK(worst_error(joined, back, back.size() - 10) < 0.05);
    CHECK(faults_of(*joined.map) == "");

    const SimulatedSource away = interrupted_lap(kOrbitFrames - 12, 100 + seed, gap);
    CHECK(run(away, false).components == 2);
  }
}

}  // namespace hybrid_slam
