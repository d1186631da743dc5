#pragma once

#include <optional>
#include <span>

#include "frontend/pose/bearing_observation.h"

namespace hybrid_slam {

// MLPnP: the maximum-likelihood pose of a camera of any model from known points, none of them an
// outlier (Urban, Leitloff, Hinz: MLPnP, a real-time maximum likelihood solution to the
// perspective-n-point problem, 2016). A linear system gives the start, with fewer unknowns where
// the points lie in a plane; Gauss-Newton on the whitened residuals gives the pose.
// Needs six observations, four if the points lie in a plane. A guess, if there is one, is a start
// beside the linear ones and does with three. None if there are too few, if they leave the pose
// open (points on a line) or are not finite.
std::optional<Rigid3d> solve_mlpnp(std::span<const BearingObservation> observations,
                                   const Rigid3d* guess = nullptr);

}  // namespace hybrid_slam
