#pragma once

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// A motion that was measured, with the covariance of its left perturbation: d in exp(d) * b_from_a,
// (translation, rotation) [m, rad].
struct UncertainMotion {
  Rigid3d b_from_a;
  Matrix6d covariance = Matrix6d::Zero();  // exactly symmetric
};

// Squared Mahalanobis distance, error^T covariance^-1 error: chi2 with 6 degrees of freedom where
// the covariance is what the error has.
double squared_mahalanobis(const Vector6d& error, const Matrix6d& covariance);

// One after the other, of errors that are independent:
//   exp(d2) B exp(d1) A = exp(d2 + adjoint(B) d1) B A, to first order.
UncertainMotion operator*(const UncertainMotion& c_from_b, const UncertainMotion& b_from_a);

// (exp(d) T)^-1 = exp(-adjoint(T^-1) d) T^-1.
UncertainMotion inverse(const UncertainMotion& b_from_a);

// As ROS has it (geometry_msgs/PoseWithCovariance) of the pose of frame a in frame b: x, y, z of
// a's origin along b's axes, then small turns about b's fixed axes x, y, z [m, rad]. Row-major and
// column-major are the same. Of a camera in the world: ros_covariance(inverse({cam_from_world,
// covariance})).
Matrix6d ros_covariance(const UncertainMotion& b_from_a);

}  // namespace hybrid_slam
