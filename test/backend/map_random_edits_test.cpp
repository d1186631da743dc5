#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

// Makes edits at random, half of what they name being stale or clashing.
class RandomEdits {
 public:
  RandomEdits(FilledMap& filled, std::uint64_t seed) : filled_(filled), random_(seed) {}

  void step() {
    MapEdit edit;
    switch (random_.below(9)) {
      case 0:
        for (int i = 0; i < 3; ++i) edit.merged.push_back({landmark(), landmark()});
        break;
      case 1:
      case 2:
        for (int i = 0; i < 20; ++i) edit.new_observations.push_back({landmark(), observation()});
        break;
      case 3:
        for (int i = 0; i < 10; ++i) {
          edit.new_landmarks.push_back({random_.gaussian3(2), {observation(), observation()}});
        }
        break;
      case 4:
        for (int i = 0; i < 5; ++i) edit.erased_observations.push_back(existing());
        edit.erased_observations.push_back({landmark(), observation()});
        break;
      case 5:
        edit.erased_landmarks.push_back(landmark());
        edit.visible.push_back(landmark());
        edit.found.push_back(landmark());
        break;
      case 6:
        if (random_.below(20) == 0) edit.erased_keyframes.push_back(keyframe());
        break;
      case 7:
        if (random_.below(20) == 0) add_keyframe();
        break;
      default:
        move();
    }
    filled_.map.apply(edit);
  }

 private:
  KeyframeId keyframe() { return filled_.keyframes[random_.below(filled_.keyframes.size())]; }
  LandmarkId landmark() { return LandmarkId(static_cast<std::uint32_t>(random_.below(1500))); }

  Observation observation() {
    const KeyframeId id = keyframe();
    const Keyframe* found = filled_.map.view().find(id);
    const std::size_t keypoints = found == nullptr ? 1 : found->landmarks.size();
    return {id, static_cast<std::uint32_t>(random_.below(keypoints))};
  }

  LandmarkObservation existing() {
    const Landmark* found = filled_.map.view().find(landmark());
    if (found == nullptr) return {landmark(), observation()};
    return {found->id, found->observations[random_.below(found->observations.size())]};
  }

  void add_keyframe() {
    const Keyframe* like = filled_.map.view().find(keyframe());
    if (like == nullptr) return;
    NewKeyframe made{like->observations, like->cam_from_world, like->landmarks, {}, keyframe()};
    for (LandmarkId& id : made.landmarks) {
      if (random_.below(3) == 0) id = landmark();
    }
    filled_.keyframes.push_back(filled_.map.add_keyframe(made));
  }

  void move() {
    const KeyframeId id = keyframe();
    const Rigid3d pose = filled_.map.view().cam_from_world(id);
    const Rigid3d motion = se3_exp(random_.vector(6, 0.01));
    filled_.map.move({{id, motion * pose}}, {{landmark(), random_.gaussian3(3)}});
  }

  FilledMap& filled_;
  Random random_;
};

TEST_CASE("5000 random edits leave a consistent map, and old snapshots as they were") {
  SyntheticSceneOptions options;
  options.times = 12;
  options.landmarks = 600;
  options.fisheye = true;
  FilledMap filled = fill_map(make_synthetic_scene(options), {});
  RandomEdits edits(filled, 3);
  const auto first = filled.map.snapshot();
  const std::size_t landmarks = first->landmark_count();
  std::shared_ptr<const MapSnapshot> latest;
  for (int i = 0; i < 5000; ++i) {
    edits.step();
    if (i % 7 == 0) latest = filled.map.snapshot();
    if (i % 250 == 0) REQUIRE(filled.map.check_consistency() == std::vector<std::string>{});
  }
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
  CHECK(filled.map.view().keyframe_count() > 3);
  CHECK(filled.map.view().keyframe_count() != filled.keyframes.size());
  CHECK(filled.map.view().landmark_count() > 20);
  CHECK(first->landmark_count() == landmarks);
  CHECK(first->keyframe_count() == 24);
  // Every keyframe there ever was still has a pose.
  for (const KeyframeId id : filled.keyframes) {
    CHECK(filled.map.view().cam_from_world(id).params.allFinite());
  }
}

}  // namespace
}  // namespace hybrid_slam
