#include "frontend/tracking/stereo_tracker.h"

#include <algorithm>
#include <set>
#include <utility>

#include <Eigen/Cholesky>

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/pose/pose_belief.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/support/filled_map.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

constexpr double kMaxDistance = 0.003;  // [m] from the true pose; the ground is 3 m away,
constexpr double kMaxAngle = 0.001;     // [rad] and keypoints are off by about 0.15 px

// Moves the whole map, as a correction would: the world's axes become others.
void move_world(const Rigid3d& new_from_old, Map& map) {
  std::vector<std::pair<KeyframeId, Rigid3d>> poses;
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
  for (const KeyframeId id : map.view().keyframe_ids()) {
    poses.emplace_back(id, map.view().at(id).cam_from_world * inverse(new_from_old));
  }
  for (const LandmarkId id : map.view().landmark_ids()) {
    points.emplace_back(id, new_from_old * map.view().at(id).point_in_world);
  }
  map.move(poses, points);
}

Rigid3d turned(double angle, const Eigen::Vector3d& translation) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, -1, 2).normalized())),
          translation};
}

// A circle over a seafloor, and a map that knows it from every second frame. The map's axes are
// none of the cameras': else all poses of the circle would commute with its motion.
struct World {
  explicit World(std::size_t stride = 2) {
    SyntheticSceneOptions options;
    options.times = 60;
    options.landmarks = 4000;
    options.noise = 0.05;
    options.clutter = 50;
    scene = make_synthetic_scene(options);
    FillOptions fill;
    fill.stride = stride;
    filled = fill_map(scene, fill);
    move(turned(1.1, {-1, 3, 2}));
  }

  void move(const Rigid3d& new_from_old) {
    move_world(new_from_old, filled.map);
    scene_from_world = scene_from_world * inverse(new_from_old);
  }
  Rigid3d true_pose(std::size_t index) const {
    return scene.frames[index].cam_from_world * scene_from_world;
  }

  const Calibrated<RectifiedStereo>& camera() const {
    return std::get<Calibrated<RectifiedStereo>>(scene.cameras.front());
  }
  StereoTracker tracker(double radius = 7) const {
    StereoTrackerOptions options;
    options.max_features = 800;
    options.last_frame_radius = radius;
    options.keyframes.min_overlap = 0;  // late: so that a keyframe brings many new points
    options.keyframes.max_new_ground = 1;
    options.keyframes.min_tracked_ratio = 0.75;
    options.keyframes.min_tracked_ratio_young = 0.4;
    return {CameraId(0), camera(), options};
  }
  const MapSnapshot& map() const { return filled.map.view(); }
  Frame frame(std::size_t index) const { return stereo_frame(scene, index); }

  SyntheticScene scene;
  FilledMap filled;
  Rigid3d scene_from_world;
};

void check_pose(const Rigid3d& estimate, const Rigid3d& truth) {
  CHECK(pose_scene::translation_error(estimate, truth) < kMaxDistance);
  CHECK(pose_scene::rotation_error(estimate, truth) < kMaxAngle);
}

// Without the right image, and so without odometry.
Frame without_right(Frame frame) {
  std::fill(frame.features.u_right.begin(), frame.features.u_right.end(), kNoRightMatch);
  std::fill(frame.features.right_of_left.begin(), frame.features.right_of_left.end(), -1);
  return frame;
}

}  // namespace

TEST_CASE("A frame is tracked by the map to its true pose") {
  const World world;
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
  const World world;
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

TEST_CASE(
    "Without odometry the pose is predicted from the last motion, without one from the pose") {
  const World world;
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
  const World world;
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
  World world;
  StereoTracker tracker = world.tracker();
  for (std::size_t i = 9; i < 12; ++i)
    REQUIRE(tracker.track(world.frame(i), world.map()).tracked());
  world.move(turned(0.7, {2, -1, 0.5}));
  const TrackedFrame tracked = tracker.track(world.frame(12), world.map());
  CHECK(tracked.source == PoseSource::kLocalMap);
  CHECK(tracked.last_frame_inliers > 100);  // the prediction was right at once
  check_pose(tracked.cam_from_world, world.true_pose(12));
}

TEST_CASE("Where the map does not reach, odometry holds the track and asks for a keyframe") {
  World world;
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
    World world;
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
  World world;
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
      World world;
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

// Tracks from frame 1 on until a keyframe is asked for, or to `last`.
TrackedFrame track_until_keyframe(StereoTracker& tracker, const World& world, bool allow_keyframe,
                                  std::size_t last) {
  TrackedFrame tracked;
  for (std::size_t i = 1; i <= last && !tracked.keyframe; ++i) {
    tracked = tracker.track(world.frame(i), world.map(), allow_keyframe);
    REQUIRE(tracked.tracked());
  }
  return tracked;
}

TEST_CASE("A keyframe has the odometry from the one before, frames between included") {
  World world(60);
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
  // A frame that the odometer cannot follow breaks the chain.
  TrackedFrame third = tracker.track(without_right(world.frame(++index)), world.map());
  REQUIRE(third.tracked());
  while (!third.keyframe) third = tracker.track(world.frame(++index), world.map());
  CHECK(third.keyframe->odometry == nullptr);
}

TEST_CASE("A keyframe is asked for where it is needed, if allowed, and once") {
  const World world(60);  // the map is what the first frame saw
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
  World world(60);
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
    World world(60);
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

TEST_CASE("Where the map shows only an edge of the image, the last frame holds the pose") {
  double squared_error = 0;
  int frames = 0;
  for (std::size_t at = 10; at < 30; ++at) {
    World world;
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

TEST_CASE("After a frame without features the camera is found again, and no motion is assumed") {
  World world;
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
  const World world(60);
  StereoTrackerOptions options;
  options.local_map_radius = -1;
  CHECK_THROWS_AS(StereoTracker(CameraId(0), world.camera(), options), std::invalid_argument);
}

}  // namespace hybrid_slam
