#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

struct StereoOdometerOptions {
  int ransac_iterations = 200;
  double inlier_threshold = 2.0;  // [px] over the four coordinates
  int min_inliers = 6;
  int max_gauss_newton_iterations = 20;  // of a hypothesis
  std::uint64_t seed = 0;

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// One point in two successive rectified stereo frames.
struct StereoCorrespondence {
  Eigen::Vector3d previous;  // (u_left, v, u_right) [px]
  Eigen::Vector4d current;   // (u_left, v_left, u_right, v_right) [px]
  // Standard deviations of the coordinates, as far as they differ between points: of all points
  // together the residuals tell [px].
  double previous_sigma = 1;
  double current_sigma = 1;
};

struct StereoMotionSolution {
  Rigid3d current_from_previous;
  // Of its left perturbation (translation, rotation): stereo_motion_covariance(). First order; what
  // all matches are off by in common is not in it.
  Matrix6d covariance;
  std::vector<int> inliers;  // indices of correspondences, ascending
};

// Ego-motion of a stereo pair as VISO2 finds it: points triangulated from the previous frame,
// hypotheses from three of them, least squares in the four coordinates in the current frame with
// the weights 1 / (|u - cu| / cu + 0.05) of the left image. Correspondences that are not finite or
// have no positive disparity in the previous frame are never inliers. None if fewer than
// min_inliers agree or they leave the motion open. Same seed, same result.
std::optional<StereoMotionSolution> solve_stereo_motion(
    const Calibrated<RectifiedStereo>& camera,
    std::span<const StereoCorrespondence> correspondences, const StereoOdometerOptions& options);

}  // namespace hybrid_slam
