#pragma once

#include <ceres/sized_cost_function.h>

#include "cameras/geometry/sim3d.h"

namespace hybrid_slam {

// A measured similarity between two cameras. Blocks: a_from_world, b_from_world (8 each,
// Sim3Manifold).
//   E = measured_a_from_b^-1 * a_from_world * b_from_world^-1
//   residual = L^T (translation of E, 2 vec(rotation of E), log scale of E),  L L^T = information
// information: 7x7 in that order, in frame b. With scale 1 everywhere the first six are those of
// RelativePoseFactor.
class RelativeSimilarityFactor final : public ceres::SizedCostFunction<7, 8, 8> {
 public:
  // Throws std::logic_error unless the information is symmetric and positive semi-definite.
  RelativeSimilarityFactor(const Sim3d& measured_a_from_b, const Matrix7d& information);

  // False if a scale is not positive.
  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  Sim3d measured_b_from_a_;
  Matrix7d whitening_;  // L^T
};

}  // namespace hybrid_slam
