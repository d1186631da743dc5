#pragma once

#include <array>
#include <cmath>

#include "cameras/geometry/rigid3d.h"
#include "cameras/geometry/so3.h"

namespace hybrid_slam {

using Vector8d = Eigen::Matrix<double, 8, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

// A similarity b_from_a: point_in_b = scale * (rotation * point_in_a) + translation. Memory, as
// handed to Ceres: 8 doubles, quaternion x y z w, then translation, then the scale (positive).
struct Sim3d {
  Vector8d params{0, 0, 0, 1, 0, 0, 0, 1};

  Sim3d() = default;
  Sim3d(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation, double scale) {
    params << rotation.normalized().coeffs(), translation, scale;
  }
  explicit Sim3d(const Rigid3d& rigid) { params << rigid.params, 1; }

  Eigen::Map<const Eigen::Quaterniond> rotation() const {
    return Eigen::Map<const Eigen::Quaterniond>(params.data());
  }
  Eigen::Map<const Eigen::Vector3d> translation() const {
    return Eigen::Map<const Eigen::Vector3d>(params.data() + 4);
  }
  double scale() const { return params[7]; }
};

inline Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return {
      c_from_b.rotation() * b_from_a.rotation(),
      c_from_b.scale() * (c_from_b.rotation() * b_from_a.translation()) + c_from_b.translation(),
      c_from_b.scale() * b_from_a.scale()};
}

inline Eigen::Vector3d operator*(const Sim3d& b_from_a, const Eigen::Vector3d& point_in_a) {
  return b_from_a.scale() * (b_from_a.rotation() * point_in_a) + b_from_a.translation();
}

inline Sim3d inverse(const Sim3d& b_from_a) {
  const Eigen::Quaterniond a_from_b_rotation = b_from_a.rotation().conjugate();
  const double a_from_b_scale = 1 / b_from_a.scale();
  return {a_from_b_rotation, -a_from_b_scale * (a_from_b_rotation * b_from_a.translation()),
          a_from_b_scale};
}

// The camera pose that sees the same directions: p -> s R p + t and p -> R p + t / s differ by the
// factor s alone, which no projection notices.
inline Rigid3d without_scale(const Sim3d& b_from_a) {
  return {b_from_a.rotation(), b_from_a.translation() / b_from_a.scale()};
}

// The integral over tau in [0, 1] of exp(tau (log_scale I + hat(omega))): what turns the
// translation part of a tangent into a translation. By Gauss-Legendre quadrature, whose error is
// below 1e-14 for |omega| <= 2 pi and |log_scale| <= 7, without the cancellations of the closed
// form near zero.
inline Eigen::Matrix3d sim3_translation_matrix(const Eigen::Vector3d& omega, double log_scale) {
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

// Tangent vectors are (translation, rotation, log scale); perturbation on the left.
inline Sim3d sim3_exp(const Vector7d& tangent) {
  const Eigen::Vector3d omega = tangent.segment<3>(3);
  return {so3_exp(omega), sim3_translation_matrix(omega, tangent[6]) * tangent.head<3>(),
          std::exp(tangent[6])};
}

// The tangent whose exp is this similarity, with a rotation part of at most pi.
inline Vector7d sim3_log(const Sim3d& b_from_a) {
  const Eigen::Vector3d omega = so3_log(b_from_a.rotation());
  const double log_scale = std::log(b_from_a.scale());
  Vector7d tangent;
  tangent << sim3_translation_matrix(omega, log_scale).inverse() * b_from_a.translation(), omega,
      log_scale;
  return tangent;
}

// S exp(d) = exp(adjoint(S) d) S.
inline Matrix7d adjoint(const Sim3d& b_from_a) {
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
