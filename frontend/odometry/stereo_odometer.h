#pragma once

#include <optional>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/matching/circular_matcher.h"
#include "frontend/matching/stereo_matcher.h"
#include "frontend/odometry/stereo_motion.h"
#include "frontend/pose/pose_belief.h"

namespace hybrid_slam {

struct StereoMotion {
  Rigid3d current_from_previous;
  Matrix6d covariance = Matrix6d::Zero();  // of its left perturbation: see StereoMotionSolution
  std::vector<CircularMatch> inliers;
  std::vector<CircularMatch> outliers;  // the other matches; of circular ones only
  int matches = 0;                      // before RANSAC
  int patches = 0;      // inliers that were followed as patches, and are no keypoints
  PoseSupport support;  // what speaks for it
};

// Ego-motion between two successive stereo frames: circular matches, then solve_stereo_motion.
// Works for large motions: no prediction is needed. Throws std::invalid_argument if the options are
// not valid.
class StereoOdometer {
 public:
  StereoOdometer(const Calibrated<RectifiedStereo>& camera, const StereoOdometerOptions& options);

  // None if fewer than min_inliers agree.
  std::optional<StereoMotion> estimate(const StereoFeatures& previous,
                                       const StereoFeatures& current) const;

 private:
  PoseSupport support(const StereoMotion& motion, const StereoFeatures& previous) const;

  Calibrated<RectifiedStereo> camera_;
  StereoOdometerOptions options_;
};

}  // namespace hybrid_slam
