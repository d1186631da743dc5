#pragma once

#include <ceres/sized_cost_function.h>

#include "cameras/geometry/rigid3d.h"
#include "factors/left_jacobian.h"

namespace hybrid_slam {

// A measured pose of one camera. Block: cam_from_world (7, PoseManifold).
//   E = cam_from_world * measured^-1,  residual = L^T (translation of E, 2 vec(rotation of E))
// with L L^T = information (6x6, translation first). The error lives in the camera's frame, as the
// left perturbation does. Rotations that differ by up to pi are told apart.
class PosePrior final : public ceres::SizedCostFunction<6, 7>, public LeftJacobian {
 public:
  // Throws std::logic_error unless the information is symmetric and positive semi-definite.
  PosePrior(const Rigid3d& measured_cam_from_world, const Matrix6d& information);

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  Rigid3d world_from_measured_;
  Matrix6d whitening_;  // L^T
};

}  // namespace hybrid_slam
