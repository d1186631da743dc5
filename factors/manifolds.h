#pragma once

#include <ceres/manifold.h>

namespace hybrid_slam {

// Manifolds of poses and similarities: Plus(x, delta) = exp(delta) * x, the perturbation on the
// left that holds everywhere in this program.
//
// Every factor of ours writes its Jacobian by such a block in the tangent space already, padded
// with zeros to the block's size: [J6 | 0] for a pose. The plus-Jacobian is the matching lift
// [I; 0], so that their product is J6 itself, and not the derivative of Plus in the quaternion's
// coordinates. Hence the rule: a block with one of these manifolds meets such factors only; a
// ceres::AutoDiffCostFunction by the quaternion's coordinates would be wrong with it, and is taken
// through left_jacobian() first (left_jacobian.h).

// 7 doubles as in Rigid3d; delta = (translation, rotation).
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;  // [I6; 0]
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;  // [I6 | 0]
};

// 8 doubles as in Sim3d; delta = (translation, rotation, log scale).
class Sim3Manifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 8; }
  int TangentSize() const override { return 7; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;  // [I7; 0]
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;  // [I7 | 0]
};

}  // namespace hybrid_slam
