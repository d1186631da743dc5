#pragma once

#include "cameras/geometry/rigid3d.h"
#include "cameras/geometry/so3.h"

// Tangent vectors of rigid transforms are (translation, rotation). Poses are perturbed on the left:
// exp(delta) * b_from_a. (Barfoot, State Estimation for Robotics, section 7.1.)

namespace hybrid_slam {

// The transform reached after unit time with the constant velocity `tangent`: rotation exp(omega),
// translation J rho.
Rigid3d se3_exp(const Vector6d& tangent);

// The tangent whose exp is this transform, with a rotation part of at most pi.
Vector6d se3_log(const Rigid3d& b_from_a);

// T exp(d) = exp(adjoint(T) d) T.
Matrix6d adjoint(const Rigid3d& b_from_a);

// The coupling of translation and rotation in se3_left_jacobian (Barfoot eq. 7.86).
Eigen::Matrix3d se3_jacobian_coupling(const Vector6d& tangent);

// exp(tangent + d) = exp(J d) exp(tangent) to first order in d, J = se3_left_jacobian(tangent).
Matrix6d se3_left_jacobian(const Vector6d& tangent);

// Inverse of se3_left_jacobian, for a rotation part below 2 pi.
Matrix6d se3_left_jacobian_inverse(const Vector6d& tangent);

}  // namespace hybrid_slam
