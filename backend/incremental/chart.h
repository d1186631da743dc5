#pragma once

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// Coordinates of a pose around a base that stays: cam_from_world = base * exp(delta), with delta =
// (translation, rotation) in the frame of the world. In them a Gaussian term is an affine function
// of one vector wherever it was linearised, which lets terms be linearised at different moments and
// still be summed exactly. And poses that move together, as one rigid body, have equal deltas: what
// joins them keeps its linearisation however far the whole is turned, since exp(a) exp(b)^-1
// depends on a - b alone to first order (docs/backend.md). Good for rotations well below pi.
inline Rigid3d chart_pose(const Rigid3d& base, const Vector6d& delta) {
  return base * se3_exp(delta);
}

// Turns derivatives by a left perturbation of the pose at `delta`, exp(d) * cam_from_world, into
// derivatives by delta: d = Ad(base) J(delta) ddelta, J: SE3's left Jacobian.
template <int kRows>
Eigen::Matrix<double, kRows, 6> by_chart(const Eigen::Matrix<double, kRows, 6>& by_left,
                                         const Rigid3d& base, const Vector6d& delta) {
  return by_left * (adjoint(base) * se3_left_jacobian(delta));
}

}  // namespace hybrid_slam
