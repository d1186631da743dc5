#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "backend/map/map_edit.h"
#include "cameras/geometry/uncertain_motion.h"

namespace hybrid_slam {

// kCoasted: a pose that nothing in the frame says, or that hangs on one; it counts as not tracked.
enum class PoseSource { kNone, kInitialization, kLocalMap, kOdometer, kRelocalization, kCoasted };

// The rung of the ladder on which the motion since the last tracked frame was found
// (docs/tracking.md).
enum class Prediction {
  kNone,
  kOdometer,          // matches that close a circle
  kLeftMatches,       // of the left image alone
  kPatches,           // followed by optical flow
  kAcrossGap,         // since a frame that was not tracked, whose own place was coasted
  kConstantVelocity,  // nothing measured
  kLastPose
};

const char* to_string(PoseSource source);
const char* to_string(Prediction prediction);

// Landmarks of one frame, each once: those that it should show, and those that were found in it.
struct SeenLandmarks {
  std::vector<LandmarkId> visible;
  std::vector<LandmarkId> found;

  bool empty() const { return visible.empty() && found.empty(); }
};

// What tracking says of one frame.
struct TrackedFrame {
  std::int64_t frame_index = 0;
  double time = 0;  // [s]
  PoseSource source = PoseSource::kNone;
  Prediction prediction = Prediction::kNone;
  Rigid3d cam_from_world;      // as known at this moment
  KeyframeId reference;        // invalid for the frame that starts the map
  Rigid3d cam_from_reference;  // through which the frame follows later corrections
  // How far off the pose may be: of its left perturbation d, exp(d) * cam_from_world, d =
  // (translation, rotation) [m, rad] along the camera's axes. It has the frame's own noise, what
  // its landmarks are off by and what the keyframes are that see these (frontend/tracking/
  // uncertain_pose.h). ros_covariance(inverse({cam_from_world, covariance})) is what ROS calls the
  // covariance of this pose.
  Matrix6d covariance = Matrix6d::Zero();
  // The keyframe against which: the map's origin, or, where the map does not know how certain it is
  // here (MapSnapshot::covariances), the one that shares most landmarks with the frame. Invalid of
  // a frame that is lost, and of the one that starts the map, which is exact.
  KeyframeId covariance_base;
  double disparity_offset = 0;  // [px] found in the rectification and removed
  double shading = 0;           // that moving lamps pretend, removed; see ShadingCalibrator
  int odometer_inliers = 0;
  int last_frame_inliers = 0;
  int inliers = 0;  // landmarks that agree with the final pose

  std::optional<NewKeyframe> keyframe;  // set if the frame shall become one
  SeenLandmarks counts;

  bool tracked() const { return source != PoseSource::kNone && !coasted(); }
  bool coasted() const { return source == PoseSource::kCoasted; }
};

}  // namespace hybrid_slam
