#pragma once

#include <array>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "cameras/geometry/rigid3d.h"
#include "cameras/rectified_stereo.h"

namespace hybrid_slam {

// A point that a stereo camera measured from two places.
struct StereoSight {
  Eigen::Vector3d previous;  // measured (u_left, v, u_right) [px]
  Eigen::Vector3d current;   // likewise
  // Variances of its place in the left images, relative to other points.
  double previous_variance = 1;
  double current_variance = 1;
};

// Variances [px^2] of what a sight is off by: u and v in the left images, each times the point's
// own, and the disparity. The three are independent: where a feature is found again in the left
// image is one question, how far the right image has shifted what is there another.
using SightNoise = Eigen::Vector3d;

struct DisparityOffsetFit {
  Rigid3d motion;          // current_from_previous, with disparities as they were measured
  SightNoise noise;        // as the residuals tell it
  double offset = 0;       // [px] by which u_right is too large, to first order
  double information = 0;  // of the offset, the motion unknown; 0 where that leaves it open
};

// The motion, from `start` on, that explains both frames with the least noise, and the offset of
// all disparities that would explain them better still. For every motion a point is where both
// frames together have it: with points where the previous frame has them, and its noise ignored, a
// motion comes out too short (errors in variables: Fuller, Measurement Error Models, 1987).
//
// Matches have more large errors than gaussian noise has. They follow Student's t with 5 degrees of
// freedom (Kerl, Sturm and Cremers, ICRA 2013): a point k standard deviations off weighs
// 8 / (5 + k^2). The noise is estimated along with the motion, from `noise` on, by expectation and
// conditional maximisation (Liu and Rubin, Statistica Sinica 1995). The information is that of an
// M-estimator, E[psi']^2 / E[psi^2] (Huber, Robust Statistics), by what the residuals are.
//
// Sights that no camera can have at the start are left out. None if fewer than 7 are left or they
// leave the motion open.
std::optional<DisparityOffsetFit> fit_disparity_offset(
    const std::array<double, RectifiedStereo::kParamCount>& params, const Rigid3d& start,
    const SightNoise& noise, std::span<const StereoSight> sights);

}  // namespace hybrid_slam
