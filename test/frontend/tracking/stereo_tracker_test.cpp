#include <algorithm>
#include <set>
#include <utility>

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "test/frontend/tracking/tracked_circle.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

TEST_CASE("A frame is tracked by the map to its true pose") {
  const TrackedCircle world;
  StereoTracker tracker = world.tracker();
  CHECK(tracker.track(world.frame(9), world.map()).source == PoseSource::kRelocalization);
  for (std::size_t i = 10; i < 20; ++i) {
    const TrackedFrame tracked = tracker.track(world.frame(i), world.map());
    CHECK(tracked.source == PoseSource::kLocalMap);
    CHECK(tracked.prediction == Prediction::kOdometer);
    CHECK(tracked.frame_index == static_cast<std::int64_t>(i));
    CHECK(tracked.time == Approx(0.1 * static_cast<double>(i)));
    CHECK(tracked.odometer_inliers > 100);
    CHECK(tracked.last_frame_inliers > 100);
    check_pose(tracked.cam_from_world, world.true_pose(i));
    REQUIRE(world.map().find(tracked.reference) != nullptr);
    check_pose(tracked.cam_from_reference * world.map().cam_from_world(tracked.reference),
               tracked.cam_from_world);
    // Every landmark found is one that the frame shows, and it was counted as visible.
    const std::set visible(tracked.counts.visible.begin(), tracked.counts.visible.end());
    std::set<LandmarkId> shown;
    for (const int landmark : world.scene.frames[i].landmark) {
      if (landmark >= 0) shown.insert(world.filled.landmarks[static_cast<std::size_t>(landmark)]);
    }
    CHECK(tracked.inliers == static_cast<int>(tracked.counts.found.size()));
    CHECK(tracked.inliers > 0.85 * static_cast<double>(shown.size()));
    for (const LandmarkId id : tracked.counts.found) {
      CHECK(visible.contains(id));
      CHECK(shown.contains(id));
    }
  }
}

TEST_CASE("A map begins with a frame that has features enough, and depths enough") {
  const TrackedCircle world;
  const Map empty;
  StereoTrackerOptions options;
  const Frame frame = world.frame(0);
  const auto with_depth =
      std::count_if(frame.features.u_right.begin(), frame.features.u_right.end(),
                    [](float u_right) { return !std::isnan(u_right); });
  REQUIRE(with_depth < static_cast<long>(frame.size()));
  options.min_initial_share = 0.5;
  for (const auto& [enough, begins] :
       {std::pair(with_depth, true), std::pair(with_depth + 1, false)}) {
    options.max_features = 2 * static_cast<int>(enough);
    StereoTracker tracker(CameraId(0), world.camera(), options);
    const TrackedFrame tracked = tracker.track(frame, empty.view());
    CHECK(tracked.source == (begins ? PoseSource::kInitialization : PoseSource::kNone));
    CHECK(tracked.keyframe.has_value() == begins);
  }
  options.max_features = 800;
  StereoTracker tracker(CameraId(0), world.camera(), options);
  const TrackedFrame tracked = tracker.track(frame, empty.view());
  REQUIRE(tracked.keyframe);
  CHECK(tracked.cam_from_world.params == Rigid3d().params);
  CHECK(static_cast<long>(tracked.keyframe->new_points.size()) == with_depth);  // all are close
  CHECK_FALSE(tracked.keyframe->reference.valid());
}

TEST_CASE("Few features begin a map where two frames in a row show the same") {
  const TrackedCircle world;
  const Map empty;
  StereoTrackerOptions options;
  options.max_features = 100 * static_cast<int>(world.frame(0).size());
  const auto track_two = [&](const Frame& first, const Frame& second) {
    StereoTracker tracker(CameraId(0), world.camera(), options);
    CHECK(tracker.track(first, empty.view()).source == PoseSource::kNone);
    return tracker.track(second, empty.view());
  };
  const TrackedFrame tracked = track_two(world.frame(0), world.frame(1));
  CHECK(tracked.source == PoseSource::kInitialization);
  CHECK(tracked.keyframe.has_value());
  CHECK(tracked.frame_index == 1);
  CHECK(tracked.cam_from_world.params == Rigid3d().params);

  Frame by_chance = world.frame(1);  // as many features, that look like others
  std::reverse(by_chance.features.left.descriptors.begin(),
               by_chance.features.left.descriptors.end());
  CHECK(track_two(world.frame(0), by_chance).source == PoseSource::kNone);
}

TEST_CASE(
    "Without odometry the pose is predicted from the last motion, without one from the pose") {
  const TrackedCircle world;
  StereoTracker tracker = world.tracker(40);
  REQUIRE(tracker.track(without_right(world.frame(9)), world.map()).tracked());
  const TrackedFrame first = tracker.track(without_right(world.frame(10)), world.map());
  CHECK(first.prediction == Prediction::kLastPose);
  check_pose(first.cam_from_world, world.true_pose(10));
  const TrackedFrame second = tracker.track(without_right(world.frame(11)), world.map());
  CHECK(second.prediction == Prediction::kConstantVelocity);
  CHECK(second.last_frame_inliers > 100);
  check_pose(second.cam_from_world, world.true_pose(11));
}

TEST_CASE("Constant velocity predicts well enough for a narrow search") {
  const TrackedCircle world;
  StereoTracker tracker = world.tracker();  // 7 px; the motion is about 45 px
  REQUIRE(tracker.track(world.frame(9), world.map()).tracked());
  const TrackedFrame left = tracker.track(without_right(world.frame(10)), world.map());
  CHECK(left.source == PoseSource::kLocalMap);
  CHECK(left.prediction == Prediction::kLeftMatches);
  const TrackedFrame tracked = tracker.track(without_right(world.frame(11)), world.map());
  CHECK(tracked.prediction == Prediction::kConstantVelocity);
  CHECK(tracked.last_frame_inliers > 100);
  check_pose(tracked.cam_from_world, world.true_pose(11));
}

TEST_CASE("The last pose follows corrections of the map") {
  TrackedCircle world;
  StereoTracker tracker = world.tracker();
  for (std::size_t i = 9; i < 12; ++i)
    REQUIRE(tracker.track(world.frame(i), world.map()).tracked());
  world.move(turned(0.7, {2, -1, 0.5}));
  const TrackedFrame tracked = tracker.track(world.frame(12), world.map());
  CHECK(tracked.source == PoseSource::kLocalMap);
  CHECK(tracked.last_frame_inliers > 100);  // the prediction was right at once
  check_pose(tracked.cam_from_world, world.true_pose(12));
}

TEST_CASE("After a frame without features the camera is found again, and no motion is assumed") {
  TrackedCircle world;
  StereoTracker tracker = world.tracker(40);
  for (std::size_t i = 9; i < 11; ++i)
    REQUIRE(tracker.track(world.frame(i), world.map()).tracked());
  Frame blank = make_frame(11, 1.1, {}, 640, 480);
  blank.features.left.kind = blank.features.right.kind = DescriptorKind::kSynthetic;
  CHECK_FALSE(tracker.track(blank, world.map()).tracked());
  const TrackedFrame found = tracker.track(world.frame(30), world.map());  // across the circle
  CHECK(found.source == PoseSource::kRelocalization);
  CHECK(found.prediction == Prediction::kNone);
  check_pose(found.cam_from_world, world.true_pose(30));
  MapEdit edit;
  edit.erased_landmarks = world.map().landmark_ids();
  world.filled.map.apply(edit);
  Frame unlike = make_frame(31, 3.1, {}, 640, 480);
  unlike.features.left.kind = unlike.features.right.kind = DescriptorKind::kSynthetic;
  CHECK_FALSE(tracker.track(unlike, world.map()).coasted());
}

TEST_CASE("An offset of all disparities is found and removed while tracking") {
  constexpr float kOffset = 0.5F;
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = 30;
  options.noise = 0.05;
  const SyntheticScene scene = make_synthetic_scene(options);
  const FilledMap filled = fill_map(scene, {});
  StereoTracker tracker(CameraId(0), std::get<Calibrated<RectifiedStereo>>(scene.cameras[0]), {});
  TrackedFrame tracked;
  for (std::size_t i = 0; i < 30; ++i) {
    Frame frame = stereo_frame(scene, i);
    for (float& u_right : frame.features.u_right) u_right += kOffset;
    for (Keypoint& keypoint : frame.features.right.keypoints) keypoint.x += kOffset;
    tracked = tracker.track(frame, filled.map.view());
  }
  CHECK(tracked.disparity_offset == Approx(kOffset).margin(0.02));
  CHECK(tracked.source == PoseSource::kLocalMap);
  check_pose(tracked.cam_from_world, scene.frames[29].cam_from_world);
}

TEST_CASE("A tracker refuses options out of range") {
  const TrackedCircle world(60);
  StereoTrackerOptions options;
  options.local_map_radius = -1;
  CHECK_THROWS_AS(StereoTracker(CameraId(0), world.camera(), options), std::invalid_argument);
}
}  // namespace
}  // namespace hybrid_slam
