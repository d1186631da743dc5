#include "frontend/tracking/fisheye_tracker.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "test/frontend/pose/pose_scene.h"
#include "test/support/filled_map.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

// A hovering pair, a wrist that swings, and a map made of every fourth moment of the pair alone, or
// of both cameras.
struct FisheyeWorld {
  explicit FisheyeWorld(bool fisheye_in_map) {
    SyntheticSceneOptions options;
    options.trajectory = SceneTrajectory::kHover;
    options.times = 40;
    options.landmarks = 3000;
    options.noise = 0.05;
    options.clutter = 100;
    options.fisheye = true;
    scene = make_synthetic_scene(options);
    FillOptions fill;
    fill.stride = fisheye_in_map ? 7 : 8;  // frames of both cameras alternate
    filled = fill_map(scene, fill);
  }

  const Camera& camera() const { return scene.cameras[1]; }
  FisheyeTracker tracker(FisheyeTrackerOptions options = {}) const {
    return {CameraId(1), std::get<Calibrated<KannalaBrandt>>(camera()), options};
  }
  const MapSnapshot& map() const { return filled.map.view(); }
  const SyntheticFrame& truth(std::size_t moment) const { return scene.frames[2 * moment + 1]; }
  Frame frame(std::size_t moment) const { return mono_frame(truth(moment), camera()); }

  SyntheticScene scene;
  FilledMap filled;
};

void check_fisheye_pose(const Rigid3d& estimate, const Rigid3d& truth) {
  CHECK(pose_scene::translation_error(estimate, truth) < 0.003);
  CHECK(pose_scene::rotation_error(estimate, truth) < 0.002);
}

}  // namespace

TEST_CASE("A swinging fisheye is placed in a map, whichever camera made it") {
  for (const bool fisheye_in_map : {false, true}) {
    const FisheyeWorld world(fisheye_in_map);
    FisheyeTracker tracker = world.tracker();
    for (std::size_t moment = 9; moment < 16; ++moment) {
      const TrackedFrame tracked = tracker.track(world.frame(moment), world.map(), KeyframeId());
      CHECK(tracked.source == (moment == 9 ? PoseSource::kRelocalization : PoseSource::kLocalMap));
      CHECK(tracked.inliers > 100);
      check_fisheye_pose(tracked.cam_from_world, world.truth(moment).cam_from_world);
      check_fisheye_pose(tracked.cam_from_reference * world.map().cam_from_world(tracked.reference),
                         tracked.cam_from_world);
    }
  }
}

TEST_CASE("The fisheye looks where the stereo pair is, when only that is known") {
  const FisheyeWorld world(false);
  FisheyeTrackerOptions options;
  options.relocalization.max_keyframes = 0;
  const KeyframeId reference = world.filled.keyframes[1];
  CHECK(!world.tracker(options).track(world.frame(9), world.map(), KeyframeId()).tracked());
  const TrackedFrame tracked = world.tracker(options).track(world.frame(9), world.map(), reference);
  CHECK(tracked.tracked());
  check_fisheye_pose(tracked.cam_from_world, world.truth(9).cam_from_world);
}

TEST_CASE("A blind fisheye is lost, and so is one elsewhere") {
  const FisheyeWorld world(false);
  FisheyeTracker tracker = world.tracker();
  REQUIRE(tracker.track(world.frame(9), world.map(), KeyframeId()).tracked());
  FeatureSet none;
  none.kind = DescriptorKind::kSynthetic;
  const Frame blind = make_mono_frame(10, 1, none, 100, 100);
  const TrackedFrame lost = tracker.track(blind, world.map(), KeyframeId());
  CHECK(!lost.tracked());
  CHECK(lost.counts.empty());
  CHECK(!lost.keyframe);
  CHECK(tracker.track(world.frame(11), world.map(), KeyframeId()).source ==
        PoseSource::kRelocalization);
  SyntheticSceneOptions options = world.scene.options;
  options.seed = 77;
  const SyntheticScene elsewhere = make_synthetic_scene(options);
  CHECK(!tracker.track(mono_frame(elsewhere.frames[19], world.camera()), world.map(), KeyframeId())
             .tracked());
}

TEST_CASE("A fisheye keyframe is what was seen, without new points") {
  const FisheyeWorld world(false);
  FisheyeTrackerOptions options;
  options.keyframes.max_frames_between = 1;
  options.keyframes.min_motion = 0;
  options.redundancy.observers = 1000;  // what others see is no reason not to
  FisheyeTracker tracker = world.tracker(options);
  const TrackedFrame tracked = tracker.track(world.frame(9), world.map(), KeyframeId());
  REQUIRE(tracked.keyframe);
  CHECK(tracked.keyframe->new_points.empty());
  CHECK(tracked.keyframe->observations->camera == CameraId(1));
  CHECK(tracked.keyframe->observations->u_right.empty());
  CHECK(tracked.keyframe->observations->frame_index == 9);
  CHECK(std::count_if(tracked.keyframe->landmarks.begin(), tracked.keyframe->landmarks.end(),
                      [](LandmarkId id) { return id.valid(); }) == tracked.inliers);
  // Until it is in the map no other one is asked for.
  CHECK(!tracker.track(world.frame(10), world.map(), KeyframeId()).keyframe);
  Map map = fill_map(world.scene, FillOptions{.stride = 8}).map;
  map.add_keyframe(*tracked.keyframe);
  CHECK(tracker.track(world.frame(11), map.view(), KeyframeId()).keyframe);
  CHECK(!tracker.track(world.frame(12), map.view(), KeyframeId(), false).keyframe);
}

// Of the map are left only landmarks within a small cone, which leave the place loose.
TEST_CASE("A fisheye frame whose place is not certain becomes no keyframe") {
  FisheyeTrackerOptions options;
  options.keyframes.max_frames_between = 1;
  options.keyframes.min_motion = 0;
  options.keyframes.min_inliers = 0;
  options.min_local_map_inliers = 8;  // so that no count decides
  options.relocalization.min_matches = 8;
  options.relocalization.min_inliers = 8;
  int tracked_frames = 0;
  int keyframes = 0;
  double worst_tracked = 0;
  double worst_keyframe = 0;
  FisheyeWorld world(false);
  for (std::size_t moment = 9; moment < 40; moment += 5) {
    for (const double cone : {0.06, 0.1, 0.15, 0.8}) {
      world.filled = fill_map(world.scene, FillOptions{.stride = 8});
      const SyntheticFrame& truth = world.truth(moment);
      MapEdit edit;
      for (const LandmarkId id : world.map().landmark_ids()) {
        const Eigen::Vector3d in_cam = truth.cam_from_world * world.map().at(id).point_in_world;
        const double off_axis =
            std::acos(in_cam.normalized().dot(Eigen::Vector3d(0.3, 0, 1).normalized()));
        if (off_axis > cone) edit.erased_landmarks.push_back(id);
      }
      world.filled.map.apply(edit);
      FisheyeTracker tracker = world.tracker(options);
      const TrackedFrame tracked = tracker.track(world.frame(moment), world.map(), KeyframeId());
      if (!tracked.tracked()) continue;
      ++tracked_frames;
      const double error =
          pose_scene::translation_error(tracked.cam_from_world, truth.cam_from_world);
      worst_tracked = std::max(worst_tracked, error);
      if (!tracked.keyframe) continue;
      ++keyframes;
      worst_keyframe = std::max(worst_keyframe, error);
    }
  }
  CAPTURE(tracked_frames, keyframes, worst_tracked, worst_keyframe);
  CHECK(keyframes > 5);
  CHECK(keyframes < tracked_frames);
  CHECK(worst_tracked > worst_keyframe);
  CHECK(worst_keyframe < 0.03);
}

TEST_CASE("FisheyeTrackerOptions out of range are refused") {
  FisheyeTrackerOptions options;
  CHECK(options.validate().empty());
  options.local_map_radius = -1;
  const FisheyeWorld world(false);
  CHECK_THROWS_AS(world.tracker(options), std::invalid_argument);
}

}  // namespace hybrid_slam
