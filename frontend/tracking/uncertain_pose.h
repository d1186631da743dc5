#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/pose/pose_refinement.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

// What the pose of a tracked frame is off by, to first order: its left perturbation d is
//   d = noise + sum_k by_keyframe_k d_k + sum_l by_landmark_l e_l,
// with d_k the left perturbation of keyframe k, and e_l what landmark l is off by where its
// keyframes are right (three independent numbers of variance 1). A frame takes over what its
// landmarks are off by, and they what the keyframes are that see them. Kept as this sum, since what
// frames have in common only shows when they are compared.
struct UncertainPose {
  using ByLandmark = Eigen::Matrix<double, 6, 3>;

  CameraId camera;
  std::int64_t frame_index = 0;
  KeyframeId reference;
  Rigid3d cam_from_reference;
  Matrix6d noise = Matrix6d::Zero();  // covariance of what the frame's own measurements bring
  std::vector<std::pair<KeyframeId, Matrix6d>> by_keyframe;    // most shared landmarks first
  std::vector<std::pair<LandmarkId, ByLandmark>> by_landmark;  // ascending

  // Of the frame that starts the map, and of a frame once it is a keyframe: it is off by what that
  // is off by.
  static UncertainPose of_keyframe(CameraId camera, std::int64_t frame_index, KeyframeId keyframe);
};

// A frame whose pose was refined on its landmarks. The information of each observation counts by as
// much as the test of outliers leaves of it (see inlier_efficiency()).
// `others`: points that the pose was refined on besides, which come from the frame `last`.
UncertainPose uncertain_pose(const MapSnapshot& map, const Camera& camera, CameraId camera_id,
                             const Frame& frame, KeyframeId reference,
                             const PoseRefinementOptions& options,
                             std::span<const PoseObservation> others = {},
                             const UncertainPose* last = nullptr);

// The frame after `pose`, by a motion that was measured between them, whose error counts as
// independent.
UncertainPose moved(const UncertainPose& pose, const UncertainMotion& motion,
                    std::int64_t frame_index);

// As the map has it by now: that of the keyframe, if the frame became one.
UncertainPose present(const MapSnapshot& map, const UncertainPose& pose);

// Writes the frame's covariance and the keyframe against which it is. Keyframes that the map knows
// nothing of (MapSnapshot::covariances) count as rigidly joined to the one that it does know and
// that shares most landmarks with the frame. If it knows none of them, that is the one that shares
// most, and the covariance is against that.
void write_covariance(const MapSnapshot& map, const UncertainPose& pose, TrackedFrame& frame);

// Two frames of the same moment: a_from_b, with all that both are off by in common. For the left
// camera and the fisheye, left_from_fisheye. Keyframes that the map knows nothing of count as
// above; if it knows none, the map around both counts as rigid.
UncertainMotion relative_pose(const MapSnapshot& map, const UncertainPose& a,
                              const UncertainPose& b);

}  // namespace hybrid_slam
