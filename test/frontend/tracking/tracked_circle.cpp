#include "test/frontend/tracking/tracked_circle.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "cameras/geometry/se3.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

constexpr double kMaxDistance = 0.003;  // [m]
constexpr double kMaxAngle = 0.001;     // [rad]

}  // namespace

Rigid3d turned(double angle, const Eigen::Vector3d& translation) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, -1, 2).normalized())),
          translation};
}

TrackedCircle::TrackedCircle(std::size_t stride) {
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

void TrackedCircle::move(const Rigid3d& new_from_old) {
  move_world(filled.map, new_from_old);
  scene_from_world = scene_from_world * inverse(new_from_old);
}

StereoTracker TrackedCircle::tracker(double radius) const {
  StereoTrackerOptions options;
  options.max_features = 800;
  options.last_frame_radius = radius;
  options.keyframes.min_overlap = 0;  // late: so that a keyframe brings many new points
  options.keyframes.max_new_ground = 1;
  options.keyframes.min_tracked_ratio = 0.75;
  options.keyframes.min_tracked_ratio_young = 0.4;
  return {CameraId(0), camera(), options};
}

Frame TrackedCircle::frame(std::size_t index) const { return stereo_frame(scene, index); }

void check_pose(const Rigid3d& estimate, const Rigid3d& truth) {
  CHECK(pose_scene::translation_error(estimate, truth) < kMaxDistance);
  CHECK(pose_scene::rotation_error(estimate, truth) < kMaxAngle);
}

TrackedFrame track_until_keyframe(StereoTracker& tracker, const TrackedCircle& world,
                                  bool allow_keyframe, std::size_t last) {
  TrackedFrame tracked;
  for (std::size_t i = 1; i <= last && !tracked.keyframe; ++i) {
    tracked = tracker.track(world.frame(i), world.map(), allow_keyframe);
    REQUIRE(tracked.tracked());
  }
  return tracked;
}

Frame without_right(Frame frame) {
  std::fill(frame.features.u_right.begin(), frame.features.u_right.end(), kNoRightMatch);
  std::fill(frame.features.right_of_left.begin(), frame.features.right_of_left.end(), -1);
  return frame;
}

}  // namespace hybrid_slam
