#include "cameras/geometry/uncertain_motion.h"

#include <Eigen/Cholesky>

namespace hybrid_slam {

double squared_mahalanobis(const Vector6d& error, const Matrix6d& covariance) {
  return error.dot(covariance.ldlt().solve(error));
}

UncertainMotion operator*(const UncertainMotion& c_from_b, const UncertainMotion& b_from_a) {
  const Matrix6d carry = adjoint(c_from_b.b_from_a);
  const Matrix6d sum = c_from_b.covariance + carry * b_from_a.covariance * carry.transpose();
  return {c_from_b.b_from_a * b_from_a.b_from_a, 0.5 * (sum + sum.transpose())};
}

UncertainMotion inverse(const UncertainMotion& b_from_a) {
  const Rigid3d a_from_b = inverse(b_from_a.b_from_a);
  const Matrix6d carry = adjoint(a_from_b);
  const Matrix6d covariance = carry * b_from_a.covariance * carry.transpose();
  return {a_from_b, 0.5 * (covariance + covariance.transpose())};
}

Matrix6d ros_covariance(const UncertainMotion& b_from_a) {
  Matrix6d carry = Matrix6d::Identity();  // the origin t goes to t + d_translation + d_rotation x t
  carry.topRightCorner<3, 3>() = -hat(b_from_a.b_from_a.translation());
  const Matrix6d covariance = carry * b_from_a.covariance * carry.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace hybrid_slam
