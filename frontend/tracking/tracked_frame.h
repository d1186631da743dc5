#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "backend/map/map_edit.h"
#include "cameras/geometry/uncertain_motion.h"

namespace hybrid_slam {

enum class PoseSource { kNone, kInitialization, kLocalMap, kOdometer, kRelocalization };
enum class Prediction { kNone, kOdometer, kConstantVelocity, kLastPose };

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

  bool tracked() const { return source != PoseSource::kNone; }
};

}  // namespace hybrid_slam
