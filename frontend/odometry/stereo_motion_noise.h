#pragma once

#include <array>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "cameras/geometry/se3.h"
#include "cameras/rectified_stereo.h"

namespace hybrid_slam {

// A point that a motion of the stereo pair is fitted to. Both frames measure it with noise, which
// has three independent parts: along the row (the mean of both images), across it, and of the
// disparity. Their variances are the point's own times those of all points (StereoNoise).
struct StereoSight {
  Eigen::Vector3d previous;  // measured (u_left, v, u_right) [px]
  Eigen::Vector3d current;   // likewise; v the mean of both rows
  double squared_weight = 1;
  double previous_variance = 1;  // of its place in the previous frame, relative to other points
  double current_variance = 1;   // likewise in the current one, and of both disparities
};

using StereoNoise = Eigen::Vector3d;  // variances along the row, across it, of the disparity [px^2]

// Of coordinates that are independent and have a variance of one.
inline StereoNoise independent_noise() { return {0.5, 1, 2}; }

// The motion, from `start` on, that explains both frames with the least noise: the cost is
// minimised over the motion and what the previous frame should have measured of each point. With
// the points where the previous frame has them, and its noise ignored, a motion comes out too
// short, by the share noise / disparity (variances): 8 % with 2 px, at 18 px (errors in variables;
// Fuller, Measurement Error Models, 1987). Only the ratios of `noise` count. None if it does not
// converge.
std::optional<Rigid3d> fit_stereo_motion(
    const std::array<double, RectifiedStereo::kParamCount>& params, const Rigid3d& start,
    std::span<const StereoSight> sights, const StereoNoise& noise);

struct StereoMotionUncertainty {
  Matrix6d covariance;  // of the motion's left perturbation (translation, rotation)
  StereoNoise noise;    // that the residuals show
};

// What a motion is off by that was fitted with weights by `assumed`, to points whose residuals,
// over the four coordinates, are no longer than `threshold` [px]. The weights are not those of the
// noise, hence both sides (a sandwich, Huber 1967):
//   H^-1 (sum J^T W C W J) H^-1,  H = sum e J^T W J,  C the covariance of a residual.
// C has the noise of both frames. It explains the squares of the residuals, of which the motion
// that was fitted has taken its part. e is what the threshold leaves of a point (inlier_efficiency:
// points that the motion moves away from leave, and pull no more). None if the points leave the
// motion open.
std::optional<StereoMotionUncertainty> stereo_motion_uncertainty(
    const std::array<double, RectifiedStereo::kParamCount>& params,
    const Rigid3d& current_from_previous, std::span<const StereoSight> sights,
    const StereoNoise& assumed, double threshold);

}  // namespace hybrid_slam
