#pragma once

#include <limits>
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
  // Who takes part in the first round: up to so many times chi2. All by default; less where the
  // initial pose is close and most observations are wrong.
  double first_scale = std::numeric_limits<double>::infinity();
};

struct PoseRefinementResult {
  Rigid3d cam_from_world;
  std::vector<char> inlier;  // one per observation
  int inliers = 0;
  Matrix6d information;  // J^T W J of the inliers at the solution, left perturbation (translation,
                         // rotation)
  double rms = 0;        // of the whitened inlier residuals
};

// What is left of an observation's information where estimates keep only observations whose squared
// whitened residual, of `dimension` 2 or 3, is below `chi2`: less than the share of them that is
// kept, since those thrown away are the ones that disagree. Of the information of those that are
// kept: 1 - (c/2)^(n/2) exp(-c/2) / (Gamma(n/2 + 1) P_n(c)), P_n the distribution of chi2. It is
// the variance of an M-estimator, E[psi^2] / E[psi']^2 (Huber, Robust Statistics), with psi of
// gaussian noise cut off. 0.84 of 2 and 0.88 of 3 dimensions at 95 %.
double inlier_efficiency(int dimension, double chi2);

// Pose of one camera from known points: damped_gauss_newton on the residuals of
// factors/reprojection.h, six unknowns. The measurements
// are (u, v, u_right) for a rectified stereo pair where u_right is given, else (u, v). Never
// returns a pose that is not finite: with too few usable observations the initial one comes back
// and `inliers` says so.
PoseRefinementResult refine_pose(const Camera& camera, const Rigid3d& initial_cam_from_world,
                                 std::span<const PoseObservation> observations,
                                 const PoseRefinementOptions& options);

}  // namespace hybrid_slam
