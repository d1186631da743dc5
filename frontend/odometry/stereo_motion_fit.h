#pragma once

#include <array>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "cameras/geometry/se3.h"
#include "cameras/rectified_stereo.h"

namespace hybrid_slam {

// A point that a motion of the stereo pair is fitted to. Both frames measure it with noise.
struct StereoSight {
  Eigen::Vector3d previous;  // measured (u_left, v, u_right) [px]
  Eigen::Vector3d current;   // likewise; v the mean of both rows
  double previous_variance =
      1;  // of its coordinates in the previous frame, relative to other points
  double current_variance = 1;  // likewise in the current one
};

// Variances [px^2] of what a sight is off by: along the row (the mean of both images), across it,
// of the disparity, each times the point's own, in both frames; and of what calibration leaves of
// the lens, at a distance of cx from the principal point: its standard deviation grows with the
// third power of that distance, as radial distortion does, and is half as large for disparities.
using StereoNoise = Eigen::Vector4d;

struct FittedStereoMotion {
  Rigid3d motion;
  Matrix6d covariance;  // of the motion's left perturbation (translation, rotation)
  StereoNoise noise;
  // If all u_right are too large by d [px], the motion is se3_exp(d * by_offset) * motion, to first
  // order.
  Vector6d by_offset;
};

// The motion, from `start` on, that explains both frames with the least noise. For every motion a
// point is where both frames together have it: with points where the previous frame has them, and
// its noise ignored, a motion comes out too short, by the share noise / disparity (variances;
// errors in variables: Fuller, Measurement Error Models, 1987).
//
// Matches have more large errors than gaussian noise has. They follow Student's t with 5 degrees of
// freedom (Kerl, Sturm and Cremers, ICRA 2013): a point k standard deviations off weighs
// 8 / (5 + k^2). The noise is estimated along with the motion, by expectation and conditional
// maximisation (Liu and Rubin, Statistica Sinica 1995).
//
// The covariance is that of an M-estimator, E[psi^2] / E[psi']^2 (Huber, Robust Statistics), by
// what the residuals are, and knows that residuals longer than `threshold` [px], over the four
// coordinates, were thrown away (inlier_efficiency). What all matches are off by in common is not
// in it. None if a point cannot be where both frames have it or the points leave the motion open.
std::optional<FittedStereoMotion> fit_stereo_motion(
    const std::array<double, RectifiedStereo::kParamCount>& params, const Rigid3d& start,
    std::span<const StereoSight> sights, double threshold);

}  // namespace hybrid_slam
