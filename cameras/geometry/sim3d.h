#pragma once

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
  Sim3d(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation, double scale);
  explicit Sim3d(const Rigid3d& rigid);

  Eigen::Map<const Eigen::Quaterniond> rotation() const {
    return Eigen::Map<const Eigen::Quaterniond>(params.data());
  }
  Eigen::Map<const Eigen::Vector3d> translation() const {
    return Eigen::Map<const Eigen::Vector3d>(params.data() + 4);
  }
  double scale() const { return params[7]; }
};

Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a);

Eigen::Vector3d operator*(const Sim3d& b_from_a, const Eigen::Vector3d& point_in_a);

Sim3d inverse(const Sim3d& b_from_a);

// The camera pose that sees the same directions: p -> s R p + t and p -> R p + t / s differ by the
// factor s alone, which no projection notices.
Rigid3d without_scale(const Sim3d& b_from_a);

// The integral over tau in [0, 1] of exp(tau (log_scale I + hat(omega))): what turns the
// translation part of a tangent into a translation. By Gauss-Legendre quadrature, whose error is
// below 1e-14 for |omega| <= 2 pi and |log_scale| <= 7, without the cancellations of the closed
// form near zero.
Eigen::Matrix3d sim3_translation_matrix(const Eigen::Vector3d& omega, double log_scale);

// Tangent vectors are (translation, rotation, log scale); perturbation on the left.
Sim3d sim3_exp(const Vector7d& tangent);

// The tangent whose exp is this similarity, with a rotation part of at most pi.
Vector7d sim3_log(const Sim3d& b_from_a);

// S exp(d) = exp(adjoint(S) d) S.
Matrix7d adjoint(const Sim3d& b_from_a);

}  // namespace hybrid_slam
