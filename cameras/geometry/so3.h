#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace hybrid_slam {

// hat(a) * b = a x b.
inline Eigen::Matrix3d hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
  return m;
}

// What remains of a Taylor series: sum over i of (-x)^i / (2 i + m)!. For 0 <= x <= 1, where the
// closed forms of sin and cos cancel.
double trigonometric_remainder(double x, int m);

// The rotation by the angle |omega| [rad] about omega.
Eigen::Quaterniond so3_exp(const Eigen::Vector3d& omega);

// The rotation vector, its length in [0, pi] [rad]. Takes a unit quaternion of either sign.
Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation);

// exp(omega + d) = exp(J d) exp(omega) to first order in d, J = so3_left_jacobian(omega).
Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& omega);

// Inverse of so3_left_jacobian, for |omega| < 2 pi.
Eigen::Matrix3d so3_left_jacobian_inverse(const Eigen::Vector3d& omega);

}  // namespace hybrid_slam
