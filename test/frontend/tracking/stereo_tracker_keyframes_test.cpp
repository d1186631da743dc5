

#include <catch2/catch.hpp>

#include "test/frontend/pose/pose_scene.h"
#include "test/frontend/tracking/tracked_circle.h"

namespace hybrid_slam {
namespace {

TEST_CASE("A keyframe is asked for where it is needed, if allowed, and once") {
  const TrackedCircle world(60);  // the map is what the first frame saw
  StereoTracker tracker = world.tracker();
  const TrackedFrame asking = track_until_keyframe(tracker, world, true, 12);
  REQUIRE(asking.keyframe);
  CHECK(asking.frame_index > 2);
  CHECK(asking.keyframe->observations->frame_index == asking.frame_index);
  CHECK(asking.keyframe->reference == world.filled.keyframes[0]);
  const auto next = static_cast<std::size_t>(asking.frame_index) + 1;
  CHECK_FALSE(tracker.track(world.frame(next), world.map()).keyframe);  // not yet in the map

  StereoTracker held_back = world.tracker();
  CHECK_FALSE(track_until_keyframe(held_back, world, false, next - 1).keyframe);
}

TEST_CASE("A new keyframe becomes the reference, and its new landmarks carry on the track") {
  TrackedCircle world(60);
  StereoTracker tracker = world.tracker();
  const TrackedFrame made = track_until_keyframe(tracker, world, true, 12);
  REQUIRE(made.keyframe);
  const std::size_t before = world.map().landmark_count();
  const KeyframeId id = world.filled.map.add_keyframe(*made.keyframe);
  CHECK(world.map().landmark_count() == before + made.keyframe->new_points.size());
  MapEdit older;  // nothing is left but what the keyframe made
  for (const LandmarkId landmark : world.map().at(world.filled.keyframes[0]).landmarks) {
    if (landmark.valid()) older.erased_landmarks.push_back(landmark);
  }
  world.filled.map.apply(older);
  const auto next = static_cast<std::size_t>(made.frame_index) + 1;
  const TrackedFrame tracked = tracker.track(world.frame(next), world.map());
  CHECK(tracked.source == PoseSource::kLocalMap);
  CHECK(tracked.last_frame_inliers > 50);
  CHECK(tracked.reference == id);
  CHECK(pose_scene::translation_error(tracked.cam_from_world, world.true_pose(next)) < 0.02);
}

TEST_CASE("A keyframe that mapping adds frames later becomes the reference, too") {
  for (const bool with_landmarks : {true, false}) {
    TrackedCircle world(60);
    StereoTracker tracker = world.tracker();
    const TrackedFrame made = track_until_keyframe(tracker, world, true, 12);
    REQUIRE(made.keyframe);
    auto frame = static_cast<std::size_t>(made.frame_index);
    const auto forget = [&] {
      MapEdit all;
      all.erased_landmarks = world.map().landmark_ids();
      world.filled.map.apply(all);
    };
    forget();  // what was known before is out of view meanwhile
    for (int lag = 0; lag < 2; ++lag) {
      CHECK(tracker.track(world.frame(++frame), world.map()).source == PoseSource::kOdometer);
    }
    const KeyframeId id = world.filled.map.add_keyframe(*made.keyframe);
    if (!with_landmarks) forget();
    world.move(turned(0.7, {2, -1, 1}));  // as a loop would move the map
    const TrackedFrame tracked = tracker.track(world.frame(++frame), world.map());
    CHECK(tracked.source == (with_landmarks ? PoseSource::kLocalMap : PoseSource::kOdometer));
    CHECK(tracked.reference == id);
    CHECK(pose_scene::translation_error(tracked.cam_from_world, world.true_pose(frame)) < 0.03);
  }
}
}  // namespace
}  // namespace hybrid_slam
