#pragma once

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// A motion that was measured, with the covariance of its left perturbation: d in exp(d) * b_from_a,
// (translation, rotation) [m, rad].
struct UncertainMotion {
  Rigid3d b_from_a;
  Matrix6d covariance = Matrix6d::Zero();  // exactly symmetric
};

// One after the other, of errors that are independent:
//   exp(d2) B exp(d1) A = exp(d2 + adjoint(B) d1) B A, to first order.
inline UncertainMotion operator*(const UncertainMotion& c_from_b, const UncertainMotion& b_from_a) {
  const Matrix6d carry = adjoint(c_from_b.b_from_a);
  const Matrix6d sum = c_from_b.covariance + carry * b_from_a.covariance * carry.transpose();
  return {c_from_b.b_from_a * b_from_a.b_from_a, 0.5 * (sum + sum.transpose())};
}

// (exp(d) T)^-1 = exp(-adjoint(T^-1) d) T^-1.
inline UncertainMotion inverse(const UncertainMotion& b_from_a) {
  const Rigid3d a_from_b = inverse(b_from_a.b_from_a);
  const Matrix6d carry = adjoint(a_from_b);
  const Matrix6d covariance = carry * b_from_a.covariance * carry.transpose();
  return {a_from_b, 0.5 * (covariance + covariance.transpose())};
}

// As ROS has it (geometry_msgs/PoseWithCovariance) of the pose of frame a in frame b: x, y, z of
// a's origin along b's axes, then small turns about b's fixed axes x, y, z [m, rad]. Row-major and
// column-major are the same. Of a camera in the world: ros_covariance(inverse({cam_from_world,
// covariance})).
inline Matrix6d ros_covariance(const UncertainMotion& b_from_a) {
  Matrix6d carry = Matrix6d::Identity();  // the origin t goes to t + d_translation + d_rotation x t
  carry.topRightCorner<3, 3>() = -hat(b_from_a.b_from_a.translation());
  const Matrix6d covariance = carry * b_from_a.covariance * carry.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace hybrid_slam
