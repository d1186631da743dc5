#pragma once

#include <vector>

#include <ceres/cost_function.h>

#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// What is known of some poses from others that are no longer sought (marginalisation), as a linear
// function around fixed bases:
//   residual = sum_i A_i delta_i + b,   cam_from_world_i = base_i * exp(delta_i)
// with delta_i = (translation, rotation) in the frame of the world. Blocks: the poses, 7 each, with
// a PoseManifold. A: rows x 6 n, in the poses' order; b: rows. The prior is never linearised anew:
// its bases stay those of the moment when the others were marginalised.
class LinearPrior final : public ceres::CostFunction {
 public:
  // Throws std::logic_error unless the sizes agree and all values are finite.
  LinearPrior(std::vector<Rigid3d> bases, Eigen::MatrixXd jacobian, Eigen::VectorXd residual);

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  std::vector<Rigid3d> bases_;
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd residual_;
};

}  // namespace hybrid_slam
