#pragma once

#include <cmath>

#include "cameras/geometry/sim3d.h"
#include "cameras/geometry/so3.h"

namespace hybrid_slam {

// How far a transform E is from the identity: (translation, 2 vec(rotation)) and, of a similarity,
// log scale; with derivatives by a perturbation of E. What factors between poses are made of.
// vec is that of the quaternion with non-negative scalar part: the shorter of the two turns.

// q with non-negative scalar part.
inline Eigen::Quaterniond shorter_turn(const Eigen::Quaterniond& q) {
  return q.w() < 0 ? Eigen::Quaterniond(-q.coeffs()) : q;
}

inline Vector6d transform_error(const Rigid3d& e) {
  Vector6d error;
  error << e.translation(), 2 * shorter_turn(e.rotation()).vec();
  return error;
}

inline Vector7d transform_error(const Sim3d& e) {
  Vector7d error;
  error << e.translation(), 2 * shorter_turn(e.rotation()).vec(), std::log(e.scale());
  return error;
}

// d error(exp(delta) * E) / d delta.
inline Matrix6d error_by_left(const Rigid3d& e) {
  const Eigen::Quaterniond q = shorter_turn(e.rotation());
  Matrix6d jacobian = Matrix6d::Identity();
  jacobian.topRightCorner<3, 3>() = -hat(e.translation());
  jacobian.bottomRightCorner<3, 3>() = q.w() * Eigen::Matrix3d::Identity() - hat(q.vec());
  return jacobian;
}

inline Matrix7d error_by_left(const Sim3d& e) {
  const Eigen::Quaterniond q = shorter_turn(e.rotation());
  Matrix7d jacobian = Matrix7d::Identity();
  jacobian.block<3, 3>(0, 3) = -hat(e.translation());
  jacobian.block<3, 1>(0, 6) = e.translation();
  jacobian.block<3, 3>(3, 3) = q.w() * Eigen::Matrix3d::Identity() - hat(q.vec());
  return jacobian;
}

// d error(E * exp(delta)) / d delta.
inline Matrix6d error_by_right(const Rigid3d& e) {
  const Eigen::Quaterniond q = shorter_turn(e.rotation());
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = q.toRotationMatrix();
  jacobian.bottomRightCorner<3, 3>() = q.w() * Eigen::Matrix3d::Identity() + hat(q.vec());
  return jacobian;
}

inline Matrix7d error_by_right(const Sim3d& e) {
  const Eigen::Quaterniond q = shorter_turn(e.rotation());
  Matrix7d jacobian = Matrix7d::Identity();
  jacobian.block<3, 3>(0, 0) = e.scale() * q.toRotationMatrix();
  jacobian.block<3, 3>(3, 3) = q.w() * Eigen::Matrix3d::Identity() + hat(q.vec());
  return jacobian;
}

// Reads a parameter block as it is, without normalising it.
template <typename Transform>
Transform from_block(const double* block) {
  Transform transform;
  transform.params = Eigen::Map<const decltype(transform.params)>(block);
  return transform;
}

// Writes a Jacobian by a tangent as one by the padded block, [J | 0]: see manifolds.h.
template <int kSize>
void write_padded(const Eigen::Matrix<double, kSize, kSize>& jacobian, double* block_jacobian) {
  Eigen::Map<Eigen::Matrix<double, kSize, kSize + 1, Eigen::RowMajor>> out(block_jacobian);
  out.template leftCols<kSize>() = jacobian;
  out.template rightCols<1>().setZero();
}

}  // namespace hybrid_slam
