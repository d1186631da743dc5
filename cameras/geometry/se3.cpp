#include "cameras/geometry/se3.h"

#include <cmath>

namespace hybrid_slam {

Rigid3d se3_exp(const Vector6d& tangent) {
  const Eigen::Vector3d omega = tangent.tail<3>();
  return {so3_exp(omega), so3_left_jacobian(omega) * tangent.head<3>()};
}

Vector6d se3_log(const Rigid3d& b_from_a) {
  const Eigen::Vector3d omega = so3_log(b_from_a.rotation());
  Vector6d tangent;
  tangent << so3_left_jacobian_inverse(omega) * b_from_a.translation(), omega;
  return tangent;
}

Matrix6d adjoint(const Rigid3d& b_from_a) {
  const Eigen::Matrix3d rotation = b_from_a.rotation().toRotationMatrix();
  Matrix6d m;
  m << rotation, hat(b_from_a.translation()) * rotation, Eigen::Matrix3d::Zero(), rotation;
  return m;
}

Eigen::Matrix3d se3_jacobian_coupling(const Vector6d& tangent) {
  const Eigen::Matrix3d p = hat(tangent.head<3>());
  const Eigen::Matrix3d w = hat(tangent.tail<3>());
  const double x = tangent.tail<3>().squaredNorm();
  const double angle = std::sqrt(x);
  const double s3 = x < 1 ? trigonometric_remainder(x, 3) : (angle - std::sin(angle)) / (x * angle);
  const double c4 =
      x < 1 ? trigonometric_remainder(x, 4) : (0.5 * x + std::cos(angle) - 1) / (x * x);
  const double s5 = x < 1 ? trigonometric_remainder(x, 5)
                          : (std::sin(angle) - angle + x * angle / 6) / (x * x * angle);
  return 0.5 * p + s3 * (w * p + p * w + w * p * w) + c4 * (w * w * p + p * w * w - 3 * w * p * w) +
         0.5 * (c4 - 3 * s5) * (w * p * w * w + w * w * p * w);
}

Matrix6d se3_left_jacobian(const Vector6d& tangent) {
  const Eigen::Matrix3d j = so3_left_jacobian(tangent.tail<3>());
  Matrix6d m;
  m << j, se3_jacobian_coupling(tangent), Eigen::Matrix3d::Zero(), j;
  return m;
}

Matrix6d se3_left_jacobian_inverse(const Vector6d& tangent) {
  const Eigen::Matrix3d j = so3_left_jacobian_inverse(tangent.tail<3>());
  Matrix6d m;
  m << j, -j * se3_jacobian_coupling(tangent) * j, Eigen::Matrix3d::Zero(), j;
  return m;
}

}  // namespace hybrid_slam
