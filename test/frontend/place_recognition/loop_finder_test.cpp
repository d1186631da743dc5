// A circle flown once, and the first keyframes of a second lap, misplaced and a part of its own.
#include "frontend/place_recognition/loop_finder.h"

#include <algorithm>
#include <memory>
#include <numbers>

#include <catch2/catch.hpp>

#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kRound = 24;  // keyframes of a lap

const Sim3d kDrift(so3_exp({0.03, -0.06, 0.05}), {0.4, -0.3, 0.1}, 1);

// The map ends with the first keyframe of the second lap, which sees a place seen before; no
// neighbour does yet.
struct SecondLap {
  SecondLap() {
    SyntheticSceneOptions options;
    options.times = 2 * kRound;
    options.step = 2 * std::numbers::pi * 3 / kRound;
    options.landmarks = 3000;
    options.noise = 0.1;
    options.clutter = 50;
    scene = make_synthetic_scene(options);
    // It begins away from the origin of the map, which cannot be erased.
    const auto second = scene.frames.begin() + kRound;
    scene.frames.erase(second, second + 4);
    SyntheticScene until_now = scene;
    until_now.frames.resize(kRound + 1);
    FillOptions fill;
    fill.split = kRound;
    fill.split_drift = kDrift;
    filled = fill_map(until_now, fill);
  }

  KeyframeId first() const { return filled.keyframes[kRound]; }

  // The second lap's next keyframe, which tracks what the first one does. Of every hundred
  // landmarks it sees so many the way they were; the others look like nothing known.
  KeyframeId add_next(int alike) {
    const SyntheticFrame& frame = scene.frames[kRound + 1];
    auto observations = std::make_shared<FrameObservations>(*frame.observations);
    NewKeyframe made;
    for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
      const int landmark = frame.landmark[k];
      made.landmarks.push_back(landmark < 0 ? LandmarkId()
                                            : filled.landmarks[static_cast<std::size_t>(landmark)]);
      Descriptor& descriptor = observations->features.descriptors[k];
      if (landmark % 100 >= alike) std::reverse(descriptor.begin(), descriptor.end());
    }
    made.observations = std::move(observations);
    made.cam_from_world = without_scale(Sim3d(frame.cam_from_world) * inverse(kDrift));
    made.reference = first();
    return filled.map.add_keyframe(made);
  }

  SyntheticScene scene;
  FilledMap filled;
};

int loops_of(const std::vector<LoopProposal>& proposals) {
  return static_cast<int>(
      std::count_if(proposals.begin(), proposals.end(),
                    [](const LoopProposal& proposal) { return proposal.verification.loop; }));
}

TEST_CASE("A loop that only misses a neighbour is one when the next keyframe confirms it") {
  SecondLap lap;
  LoopFinder finder(std::make_shared<KeyframeDatabase>(scene_vocabulary(lap.scene)), {});
  const auto alone = finder.find(lap.filled.map.view(), lap.first());
  REQUIRE(!alone.empty());
  CHECK(loops_of(alone) == 0);
  CHECK(alone.front().verification.reason == LoopRejection::kUnconfirmed);

  const KeyframeId next = lap.add_next(8);  // too little for a loop of its own
  const auto confirmed = finder.find(lap.filled.map.view(), next);
  REQUIRE(loops_of(confirmed) == 1);
  const LoopProposal& proposal = confirmed.back();
  CHECK(proposal.keyframe == lap.first());
  CHECK(proposal.match == alone.front().match);
  const LoopMeasurement& loop = *proposal.verification.loop;
  CHECK(loop.keyframe == lap.first());
  const auto older = static_cast<std::size_t>(
      std::find(lap.filled.keyframes.begin(), lap.filled.keyframes.end(), loop.match) -
      lap.filled.keyframes.begin());
  const Rigid3d truth =
      lap.scene.frames[kRound].cam_from_world * inverse(lap.scene.frames[older].cam_from_world);
  const Rigid3d off = inverse(truth) * without_scale(loop.keyframe_from_match);
  CHECK(off.translation().norm() < 0.01);
  CHECK(so3_log(off.rotation()).norm() < 0.003);

  // Told once.
  CHECK(loops_of(finder.find(lap.filled.map.view(), next)) == 0);
}

TEST_CASE("A next keyframe that sees another place confirms nothing") {
  SecondLap lap;
  LoopFinder finder(std::make_shared<KeyframeDatabase>(scene_vocabulary(lap.scene)), {});
  REQUIRE(!finder.find(lap.filled.map.view(), lap.first()).empty());
  CHECK(loops_of(finder.find(lap.filled.map.view(), lap.add_next(0))) == 0);
}

TEST_CASE("What the map has lost is not looked at again") {
  for (const bool lose_keyframe : {true, false}) {
    SecondLap lap;
    LoopFinder finder(std::make_shared<KeyframeDatabase>(scene_vocabulary(lap.scene)), {});
    const auto alone = finder.find(lap.filled.map.view(), lap.first());
    REQUIRE(!alone.empty());
    const KeyframeId next = lap.add_next(8);
    MapEdit edit;
    for (const LoopProposal& proposal : alone) {
      edit.erased_keyframes.push_back(lose_keyframe ? proposal.keyframe : proposal.match);
    }
    lap.filled.map.apply(edit);
    const auto found = finder.find(lap.filled.map.view(), next);
    CHECK(std::none_of(found.begin(), found.end(), [&](const LoopProposal& proposal) {
      return proposal.keyframe == lap.first();
    }));
  }
}

}  // namespace
}  // namespace hybrid_slam
