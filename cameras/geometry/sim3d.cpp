#include "cameras/geometry/sim3d.h"

#include <array>
#include <cmath>

namespace hybrid_slam {

Sim3d::Sim3d(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation, double scale) {
  params << rotation.normalized().coeffs(), translation, scale;
}

Sim3d::Sim3d(const Rigid3d& rigid) { params << rigid.params, 1; }

Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return {
      c_from_b.rotation() * b_from_a.rotation(),
      c_from_b.scale() * (c_from_b.rotation() * b_from_a.translation()) + c_from_b.translation(),
      c_from_b.scale() * b_from_a.scale()};
}

Eigen::Vector3d operator*(const Sim3d& b_from_a, const Eigen::Vector3d& point_in_a) {
  return b_from_a.scale() * (b_from_a.rotation() * point_in_a) + b_from_a.translation();
}

Sim3d inverse(const Sim3d& b_from_a) {
  const Eigen::Quaterniond a_from_b_rotation = b_from_a.rotation().conjugate();
  const double a_from_b_scale = 1 / b_from_a.scale();
  return {a_from_b_rotation, -a_from_b_scale * (a_from_b_rotation * b_from_a.translation()),
          a_from_b_scale};
}

Rigid3d without_scale(const Sim3d& b_from_a) {
  return {b_from_a.rotation(), b_from_a.translation() / b_from_a.scale()};
}

Eigen::Matrix3d sim3_translation_matrix(const Eigen::Vector3d& omega, double log_scale) {
  constexpr std::array<double, 6> kNodes = {0.1252334085114689, 0.3678314989981802,
                                            0.5873179542866175, 0.7699026741943047,
                                            0.9041172563704749, 0.9815606342467192};
  constexpr std::array<double, 6> kWeights = {0.2491470458134028, 0.2334925365383548,
                                              0.2031674267230659, 0.1600783285433462,
                                              0.1069393259953184, 0.0471753363865118};
  const auto sinc = [](double x) { return std::abs(x) < 1e-4 ? 1 - x * x / 6 : std::sin(x) / x; };
  const double angle = omega.norm();
  double a = 0;
  double b = 0;
  double c = 0;
  for (std::size_t i = 0; i < kNodes.size(); ++i) {
    for (const double node : {-kNodes[i], kNodes[i]}) {
      const double tau = 0.5 * (1 + node);
      const double weight = 0.5 * kWeights[i] * std::exp(log_scale * tau);
      const double half_sinc = sinc(0.5 * angle * tau);
      a += weight * tau * sinc(angle * tau);
      b += weight * 0.5 * tau * tau * half_sinc * half_sinc;
      c += weight;
    }
  }
  const Eigen::Matrix3d h = hat(omega);
  return c * Eigen::Matrix3d::Identity() + a * h + b * h * h;
}

Sim3d sim3_exp(const Vector7d& tangent) {
  const Eigen::Vector3d omega = tangent.segment<3>(3);
  return {so3_exp(omega), sim3_translation_matrix(omega, tangent[6]) * tangent.head<3>(),
          std::exp(tangent[6])};
}

Vector7d sim3_log(const Sim3d& b_from_a) {
  const Eigen::Vector3d omega = so3_log(b_from_a.rotation());
  const double log_scale = std::log(b_from_a.scale());
  Vector7d tangent;
  tangent << sim3_translation_matrix(omega, log_scale).inverse() * b_from_a.translation(), omega,
      log_scale;
  return tangent;
}

Matrix7d adjoint(const Sim3d& b_from_a) {
  const Eigen::Matrix3d rotation = b_from_a.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = b_from_a.translation();
  Matrix7d m = Matrix7d::Zero();
  m.topLeftCorner<3, 3>() = b_from_a.scale() * rotation;
  m.block<3, 3>(0, 3) = hat(translation) * rotation;
  m.block<3, 1>(0, 6) = -translation;
  m.block<3, 3>(3, 3) = rotation;
  m(6, 6) = 1;
  return m;
}

}  // namespace hybrid_slam
