#pragma once

#include <span>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// A known point and where the camera saw it.
struct PoseObservation {
  Eigen::Vector3d point_in_world;
  Eigen::Vector3d measurement;  // (u, v, u_right); u_right is NaN where only (u, v) was seen
  double sigma = 1;             // standard deviation of each coordinate [px]
};

struct PoseRefinementOptions {
  int rounds = 4;              // outliers are tested anew after each
  int iterations = 10;         // per round, at most
  int robust_rounds = 2;       // Huber loss in the first rounds, none after
  double chi2_mono = 5.991;    // 95 %, 2 degrees of freedom
  double chi2_stereo = 7.815;  // 95 %, 3 degrees of freedom
};

struct PoseRefinementResult {
  Rigid3d cam_from_world;
  std::vector<char> inlier;  // one per observation
  int inliers = 0;
  Matrix6d information;  // J^T W J of the inliers at the solution, left perturbation (translation,
                         // rotation)
  double rms = 0;        // of the whitened inlier residuals
};

// Pose of one camera from known points: damped_gauss_newton on the residuals of
// factors/reprojection.h, six unknowns. The measurements
// are (u, v, u_right) for a rectified stereo pair where u_right is given, else (u, v). Never
// returns a pose that is not finite: with too few usable observations the initial one comes back
// and `inliers` says so.
PoseRefinementResult refine_pose(const Camera& camera, const Rigid3d& initial_cam_from_world,
                                 std::span<const PoseObservation> observations,
                                 const PoseRefinementOptions& options);

}  // namespace hybrid_slam
