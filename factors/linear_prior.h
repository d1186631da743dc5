#pragma once

#include <vector>

#include <ceres/cost_function.h>

#include "cameras/geometry/rigid3d.h"
#include "factors/left_jacobian.h"
#include "factors/prior_block.h"

namespace hybrid_slam {

// What is known of some variables from others that are no longer sought (marginalisation), as a
// linear function around fixed bases:
//   residual = sum_i A_i delta_i + b,   cam_from_world_i = base_i * exp(delta_i)
// with delta_i = (translation, rotation) in the frame of the world, and of a block the difference
// from its base. Blocks: the poses, 7 each, with a PoseManifold, then the others. A: rows x (6 n +
// tangents of the blocks), in that order; b: rows. The prior is never linearised anew: its bases
// stay those of the moment when the others were marginalised. On a manifold, derivatives are those
// at the base, to first order.
class LinearPrior final : public ceres::CostFunction, public LeftJacobian {
 public:
  // Throws std::logic_error unless the sizes agree and all values are finite.
  LinearPrior(std::vector<Rigid3d> bases, Eigen::MatrixXd jacobian, Eigen::VectorXd residual,
              std::vector<PriorBlock> blocks = {});

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  void add_block(std::size_t k, const double* const* blocks, Eigen::Map<Eigen::VectorXd>& residual,
                 double** jacobians) const;

  std::vector<Rigid3d> bases_;
  std::vector<PriorBlock> others_;
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd residual_;
};

}  // namespace hybrid_slam
