#pragma once

#include <ceres/sized_cost_function.h>

#include "cameras/geometry/rigid3d.h"
#include "factors/left_jacobian.h"

namespace hybrid_slam {

// A measured motion between two cameras. Blocks: a_from_world, b_from_world (7 each, PoseManifold).
//   E = measured_a_from_b^-1 * a_from_world * b_from_world^-1
//   residual = L^T (translation of E, 2 vec(rotation of E)),  L L^T = information
// information: 6x6, translation first, in frame b; zero where nothing was measured. Whitened by L^T
// and not by L, which would minimise another chi2 as soon as the information is not isotropic. The
// scalar part of E's quaternion is taken as non-negative: of the two turns, the shorter one.
class RelativePoseFactor final : public ceres::SizedCostFunction<6, 7, 7>, public LeftJacobian {
 public:
  // Throws std::logic_error unless the information is symmetric and positive semi-definite.
  RelativePoseFactor(const Rigid3d& measured_a_from_b, const Matrix6d& information);

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  Rigid3d measured_b_from_a_;
  Matrix6d whitening_;  // L^T: see whitening.h
};

}  // namespace hybrid_slam
