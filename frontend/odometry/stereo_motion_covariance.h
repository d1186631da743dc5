#pragma once

#include <array>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "cameras/geometry/se3.h"
#include "cameras/rectified_stereo.h"

namespace hybrid_slam {

// A point that a motion of the stereo pair was fitted to.
struct StereoSight {
  Eigen::Vector3d in_previous;  // triangulated from the previous frame
  Eigen::Vector4d measured;     // (u_left, v_left, u_right, v_right) in the current frame [px]
  double squared_weight;        // that its four residuals had
  double previous_variance;  // of its coordinates in the previous frame, relative to other points
  double current_variance;   // likewise in the current one
};

// The covariance of a motion's left perturbation (translation, rotation), fitted by weighted least
// squares to points whose residuals, over the four coordinates, are no longer than `threshold`
// [px]. The weights are not those of the noise, hence both sides (a sandwich, Huber 1967):
//   H^-1 (sum J^T W C W J) H^-1,  H = sum e J^T W J,  C the covariance of a residual.
// C has the noise of both frames: three variances, of the place along the row, across it and of the
// disparity, times the point's own. They explain the squares of the residuals, of which the motion
// that was fitted has taken its part. e is what the threshold leaves of a point (inlier_efficiency:
// points that the motion moves away from leave, and pull no more). None if the points leave the
// motion open.
std::optional<Matrix6d> stereo_motion_covariance(
    const std::array<double, RectifiedStereo::kParamCount>& params,
    const Rigid3d& current_from_previous, std::span<const StereoSight> sights, double threshold);

}  // namespace hybrid_slam
