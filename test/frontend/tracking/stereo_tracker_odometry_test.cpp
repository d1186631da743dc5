#include <set>
#include <utility>

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/pose/pose_belief.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/frontend/tracking/tracked_circle.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

TEST_CASE("Where the map does not reach, odometry holds the track and asks for a keyframe") {
  TrackedCircle world;
  StereoTracker tracker = world.tracker();
  REQUIRE(tracker.track(world.frame(9), world.map()).tracked());
  REQUIRE(tracker.track(world.frame(10), world.map()).tracked());
  MapEdit edit;
  edit.erased_landmarks = world.map().landmark_ids();
  world.filled.map.apply(edit);
  const TrackedFrame tracked = tracker.track(world.frame(11), world.map());
  CHECK(tracked.source == PoseSource::kOdometer);
  CHECK(tracked.inliers < 30);
  CHECK(tracked.counts.empty());
  CHECK(pose_scene::translation_error(tracked.cam_from_world, world.true_pose(11)) < 0.02);
  REQUIRE(tracked.keyframe);
  CHECK(tracked.keyframe->new_points.size() > 200);
  const TrackedFrame left = tracker.track(without_right(world.frame(12)), world.map());
  CHECK(left.source == PoseSource::kOdometer);
  CHECK(left.prediction == Prediction::kLeftMatches);
  CHECK(pose_scene::translation_error(left.cam_from_world, world.true_pose(12)) < 0.02);
  CHECK_FALSE(left.keyframe);  // it would bring nothing
}

TEST_CASE("A frame that shows nothing costs nothing but itself") {
  for (const int blank_frames : {1, 3}) {
    TrackedCircle world;
    StereoTracker tracker = world.tracker();
    for (std::size_t i = 9; i < 13; ++i) {
      REQUIRE(tracker.track(world.frame(i), world.map()).tracked());
    }
    std::size_t next = 13;
    TrackedFrame coasted;
    double last_sigma = 0;
    for (int i = 0; i < blank_frames; ++i, ++next) {
      Frame blank = make_frame(static_cast<std::int64_t>(next), 0.1 * static_cast<double>(next), {},
                               640, 480);
      blank.features.left.kind = blank.features.right.kind = DescriptorKind::kSynthetic;
      coasted = tracker.track(blank, world.map());
      CHECK(coasted.source == PoseSource::kCoasted);
      CHECK(coasted.prediction == Prediction::kConstantVelocity);
      CHECK_FALSE(coasted.tracked());
      CHECK_FALSE(coasted.keyframe);
      CHECK(tracker.uncertain_pose() == nullptr);
      CHECK(translation_sigma(coasted.covariance) > last_sigma);
      last_sigma = translation_sigma(coasted.covariance);
      CHECK(pose_scene::translation_error(coasted.cam_from_world, world.true_pose(next)) <
            4 * last_sigma);
    }
    MapEdit edit;  // not by the map, but from the last good frame
    edit.erased_landmarks = world.map().landmark_ids();
    world.filled.map.apply(edit);
    const TrackedFrame after = tracker.track(world.frame(next), world.map());
    CHECK(after.source == PoseSource::kOdometer);
    CHECK(after.prediction == Prediction::kOdometer);
    CHECK(pose_scene::translation_error(after.cam_from_world, world.true_pose(next)) < 0.05);
  }
}

// Nothing that the last good frame saw is in view any more, and the map has nothing either.
TEST_CASE("Odometry goes on across a gap, as uncertain as the gap leaves it") {
  TrackedCircle world;
  StereoTracker tracker = world.tracker();
  double time = 0;
  const auto track = [&](std::size_t index) {
    Frame frame = world.frame(index);
    frame.time = time += 0.1;
    return tracker.track(frame, world.map());
  };
  for (const std::size_t i : {9, 11, 13, 16, 18}) REQUIRE(track(i).tracked());  // unsteadily
  MapEdit edit;
  edit.erased_landmarks = world.map().landmark_ids();
  world.filled.map.apply(edit);
  TrackedFrame tracked = track(37);  // across the circle
  CHECK(tracked.source == PoseSource::kCoasted);
  CHECK(tracked.prediction == Prediction::kConstantVelocity);
  for (std::size_t i = 38; i < 42; ++i) {
    const TrackedFrame before = std::exchange(tracked, track(i));
    CHECK(tracked.source == PoseSource::kCoasted);
    CHECK(tracked.prediction == Prediction::kAcrossGap);
    CHECK(tracked.odometer_inliers > 100);
    CHECK(translation_sigma(tracked.covariance) > 0.02 * 3);
    const Rigid3d step = tracked.cam_from_world * inverse(before.cam_from_world);
    const Rigid3d truth = world.true_pose(i) * inverse(world.true_pose(i - 1));
    CHECK(pose_scene::translation_error(step, truth) < 0.02);
  }
}

// A few landmarks of the map are wrong in common, by more than they are seen off: all others that
// the odometer followed say so.
TEST_CASE("A keyframe by odometry takes nothing along of a pose that was rejected") {
  for (const double shift : {0.02, 0.0}) {  // [m]
    for (const std::size_t shared : {1, 4, 8, 15, 22, 29}) {
      TrackedCircle world;
      StereoTracker tracker = world.tracker();
      REQUIRE(tracker.track(world.frame(9), world.map()).tracked());
      REQUIRE(tracker.track(world.frame(10), world.map()).tracked());
      const Frame next = world.frame(11);
      MapEdit edit;
      std::vector<std::pair<LandmarkId, Eigen::Vector3d>> moved;
      const auto& seen = world.scene.frames[11].landmark;
      std::set<LandmarkId> left;
      for (const int index : seen) {
        const LandmarkId id =
            index < 0 ? LandmarkId() : world.filled.landmarks[static_cast<std::size_t>(index)];
        if (id.valid() && left.size() < shared) left.insert(id);
      }
      for (const LandmarkId id : world.map().landmark_ids()) {
        if (!left.contains(id)) {
          edit.erased_landmarks.push_back(id);
        } else {
          moved.emplace_back(id, world.map().at(id).point_in_world + Eigen::Vector3d(shift, 0, 0));
        }
      }
      world.filled.map.apply(edit);
      world.filled.map.move({}, moved);
      const TrackedFrame tracked = tracker.track(next, world.map());
      INFO(shared << " landmarks, off by " << shift << " m");
      CHECK(pose_scene::translation_error(tracked.cam_from_world, world.true_pose(11)) < 0.005);
      if (shift == 0 && tracked.source == PoseSource::kLocalMap) {
        CHECK(shared >= 8);
        continue;
      }
      REQUIRE(tracked.source == PoseSource::kOdometer);
      REQUIRE(tracked.keyframe);
      const std::size_t kept = valid_ids(tracked.keyframe->landmarks).size();
      if (shift > 0) {
        CHECK(kept == 0);
      }
      // Keypoints are where they were seen.
      const auto& keypoints = tracked.keyframe->observations->features.keypoints;
      for (std::size_t k = 0; k < keypoints.size(); ++k) {
        CHECK(keypoints[k].x == next.features.left.keypoints[k].x);
      }
    }
  }
}

void forget_landmarks(TrackedCircle& world) {
  MapEdit edit;
  edit.erased_landmarks = world.map().landmark_ids();
  world.filled.map.apply(edit);
}

// The keyframe that `after` became is held by the one that `made` became, to `sigma` [m], and by
// what is true.
void check_odometry(const TrackedCircle& world, const TrackedFrame& made, const TrackedFrame& after,
                    KeyframeId before, double sigma) {
  CHECK(after.source == PoseSource::kOdometer);
  REQUIRE(after.keyframe);
  REQUIRE(after.keyframe->odometry != nullptr);
  const Odometry& odometry = *after.keyframe->odometry;
  CHECK(odometry.previous == before);
  const Rigid3d truth = world.true_pose(static_cast<std::size_t>(after.frame_index)) *
                        inverse(world.true_pose(static_cast<std::size_t>(made.frame_index)));
  const Vector6d off = se3_log(odometry.motion.b_from_a * inverse(truth));
  CHECK(squared_mahalanobis(off, odometry.motion.covariance) < 22.5);  // chi2: 99.9 %
  CHECK(translation_sigma(odometry.motion.covariance) < sigma);
}

TEST_CASE("A keyframe has the odometry from the one before, frames between included") {
  TrackedCircle world(60);
  StereoTracker tracker = world.tracker();
  const auto add = [&](const TrackedFrame& made) {
    REQUIRE(made.keyframe);
    return world.filled.map.add_keyframe(*made.keyframe);
  };
  const TrackedFrame first = track_until_keyframe(tracker, world, true, 20);
  CHECK(first.keyframe->odometry == nullptr);  // the map's keyframe is none of this tracker's
  const KeyframeId first_id = add(first);
  TrackedFrame second;
  auto index = static_cast<std::size_t>(first.frame_index);
  for (int held_back = 0; !second.keyframe; ++held_back) {
    second = tracker.track(world.frame(++index), world.map(), held_back >= 3);
  }
  REQUIRE(second.frame_index > first.frame_index + 3);
  REQUIRE(second.keyframe->odometry != nullptr);
  const Odometry& odometry = *second.keyframe->odometry;
  CHECK(odometry.previous == first_id);
  const Rigid3d motion = world.true_pose(index) *
                         inverse(world.true_pose(static_cast<std::size_t>(first.frame_index)));
  const Vector6d off = se3_log(odometry.motion.b_from_a * inverse(motion));
  CHECK(squared_mahalanobis(off, odometry.motion.covariance) < 22.5);  // chi2: 99.9 %
  CHECK(odometry.motion.covariance.diagonal().cwiseSqrt().maxCoeff() < 0.02);
  CHECK(static_cast<int>(odometry.keypoints.size()) == second.odometer_inliers);
  const KeyframeId second_id = add(second);
  CHECK(world.map().at(second_id).odometry != nullptr);
}

// The odometer cannot follow a frame without depths, and the map has the frames on both sides. The
// frame after them, in which the map shows nothing, becomes a keyframe.
TEST_CASE("Where the odometer gave no motion between keyframes, the map's is in its place") {
  TrackedCircle world(60);
  StereoTracker tracker = world.tracker();
  const TrackedFrame made = track_until_keyframe(tracker, world, true, 20);
  REQUIRE(made.keyframe);
  const KeyframeId before = world.filled.map.add_keyframe(*made.keyframe);
  auto index = static_cast<std::size_t>(made.frame_index);
  for (int i = 0; i < 2; ++i) {
    const Frame next = world.frame(++index);
    const TrackedFrame tracked =
        tracker.track(i == 0 ? without_right(next) : next, world.map(), false);
    CHECK(tracked.source == PoseSource::kLocalMap);
  }
  forget_landmarks(world);
  const TrackedFrame after = tracker.track(world.frame(++index), world.map());
  check_odometry(world, made, after, before, 0.02);
}

// As where known ground comes back into view after drift, or where the odometer follows what moves.
TEST_CASE("Where the map contradicts the odometer, its motion counts as off by as much") {
  TrackedCircle world(60);
  StereoTracker tracker = world.tracker();
  const TrackedFrame made = track_until_keyframe(tracker, world, true, 20);
  REQUIRE(made.keyframe);
  const KeyframeId before = world.filled.map.add_keyframe(*made.keyframe);
  auto index = static_cast<std::size_t>(made.frame_index);
  const Eigen::Vector3d shift(0.01, -0.01, 0.01);
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> moved;
  for (const LandmarkId id : world.map().landmark_ids()) {
    moved.emplace_back(id, world.map().at(id).point_in_world + shift);
  }
  world.filled.map.move({}, moved);
  const TrackedFrame jumped = tracker.track(world.frame(++index), world.map(), false);
  CHECK(jumped.source == PoseSource::kLocalMap);
  CHECK(pose_scene::translation_error(jumped.cam_from_world, world.true_pose(index)) > 0.01);
  forget_landmarks(world);
  const TrackedFrame after = tracker.track(world.frame(++index), world.map());
  check_odometry(world, made, after, before, 0.03);
  const Matrix6d& covariance = after.keyframe->odometry->motion.covariance;
  CHECK(covariance.topLeftCorner<3, 3>().trace() > shift.squaredNorm());
}

TEST_CASE("Where the map shows only an edge of the image, the last frame holds the pose") {
  double squared_error = 0;
  int frames = 0;
  for (std::size_t at = 10; at < 30; ++at) {
    TrackedCircle world;
    StereoTracker tracker = world.tracker();
    REQUIRE(tracker.track(world.frame(at - 1), world.map()).tracked());
    REQUIRE(tracker.track(world.frame(at), world.map()).tracked());
    MapEdit edit;
    for (const LandmarkId id : world.map().landmark_ids()) {
      const auto seen =
          project(world.camera(), world.true_pose(at + 1) * world.map().at(id).point_in_world);
      if (!seen || seen->x() > 0.12 * world.camera().width) edit.erased_landmarks.push_back(id);
    }
    world.filled.map.apply(edit);
    const TrackedFrame tracked = tracker.track(world.frame(at + 1), world.map());
    if (tracked.source != PoseSource::kLocalMap) continue;
    CHECK(tracked.inliers < 0.25 * tracked.odometer_inliers);
    CHECK(tracked.inliers == static_cast<int>(tracked.counts.found.size()));
    const double error =
        pose_scene::rotation_error(tracked.cam_from_world, world.true_pose(at + 1));
    squared_error += error * error;
    ++frames;
  }
  REQUIRE(frames > 10);
  // Measured: 0.18 mrad, and 0.51 by the strip alone.
  CHECK(std::sqrt(squared_error / frames) < 0.0003);
}
}  // namespace
}  // namespace hybrid_slam
