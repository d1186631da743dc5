#include "cameras/geometry/so3.h"

#include <cmath>

namespace hybrid_slam {

double trigonometric_remainder(double x, int m) {
  double term = 1;
  for (int i = 2; i <= m; ++i) term /= i;
  double sum = term;
  for (int i = 1; i < 10; ++i) {
    term *= -x / ((2 * i + m - 1) * (2 * i + m));
    sum += term;
  }
  return sum;
}

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& omega) {
  const double angle2 = omega.squaredNorm();
  const double angle = std::sqrt(angle2);
  const double half_sinc = angle2 < 1e-8 ? 0.5 - angle2 / 48 : std::sin(0.5 * angle) / angle;
  const Eigen::Vector3d v = half_sinc * omega;
  return Eigen::Quaterniond(std::cos(0.5 * angle), v[0], v[1], v[2]);
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0 ? -1 : 1;
  const double w = sign * rotation.w();
  const double sine = rotation.vec().norm();
  const double scale =
      sine < 1e-4 ? (2 - 2 * sine * sine / (3 * w * w)) / w : 2 * std::atan2(sine, w) / sine;
  return sign * scale * rotation.vec();
}

Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& omega) {
  const double x = omega.squaredNorm();
  const double angle = std::sqrt(x);
  const double half_sine = std::sin(0.5 * angle);
  const double a = x < 1 ? trigonometric_remainder(x, 2) : 2 * half_sine * half_sine / x;
  const double b = x < 1 ? trigonometric_remainder(x, 3) : (angle - std::sin(angle)) / (x * angle);
  const Eigen::Matrix3d h = hat(omega);
  return Eigen::Matrix3d::Identity() + a * h + b * h * h;
}

Eigen::Matrix3d so3_left_jacobian_inverse(const Eigen::Vector3d& omega) {
  const double x = omega.squaredNorm();
  const double half = 0.5 * std::sqrt(x);
  const double c = x < 1e-2 ? 1.0 / 12 + x * (1.0 / 720 + x * (1.0 / 30240 + x / 1209600))
                            : (1 - half * std::cos(half) / std::sin(half)) / x;
  const Eigen::Matrix3d h = hat(omega);
  return Eigen::Matrix3d::Identity() - 0.5 * h + c * h * h;
}

}  // namespace hybrid_slam
