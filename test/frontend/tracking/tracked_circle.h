#pragma once

#include <catch2/catch.hpp>

#include "frontend/tracking/stereo_tracker.h"
#include "test/support/filled_map.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

// A circle over a seafloor, and a map that knows it from every second frame. The map's axes are
// none of the cameras': else all poses of the circle would commute with its motion.
struct TrackedCircle {
  explicit TrackedCircle(std::size_t stride = 2);

  void move(const Rigid3d& new_from_old);
  Rigid3d true_pose(std::size_t index) const {
    return scene.frames[index].cam_from_world * scene_from_world;
  }
  const Calibrated<RectifiedStereo>& camera() const {
    return std::get<Calibrated<RectifiedStereo>>(scene.cameras.front());
  }
  StereoTracker tracker(double radius = 7) const;
  const MapSnapshot& map() const { return filled.map.view(); }
  Frame frame(std::size_t index) const;

  SyntheticScene scene;
  FilledMap filled;
  Rigid3d scene_from_world;
};

// Checks that a pose is true: to 3 mm and 1 mrad. The ground is 3 m away, and keypoints are off by
// about 0.15 px.
void check_pose(const Rigid3d& estimate, const Rigid3d& truth);

// Tracks from frame 1 on until a keyframe is asked for, or to `last`.
TrackedFrame track_until_keyframe(StereoTracker& tracker, const TrackedCircle& world,
                                  bool allow_keyframe, std::size_t last);

// Without the right image, and so without odometry.
Frame without_right(Frame frame);

Rigid3d turned(double angle, const Eigen::Vector3d& translation);

}  // namespace hybrid_slam
