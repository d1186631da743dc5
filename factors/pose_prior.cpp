#include "factors/pose_prior.h"

#include "factors/transform_error.h"
#include "factors/whitening.h"

namespace hybrid_slam {

PosePrior::PosePrior(const Rigid3d& measured_cam_from_world, const Matrix6d& information)
    : world_from_measured_(inverse(measured_cam_from_world)),
      whitening_(whitening_of(information)) {}

bool PosePrior::Evaluate(const double* const* blocks, double* residual, double** jacobians) const {
  const Rigid3d error = from_block<Rigid3d>(blocks[0]) * world_from_measured_;
  Eigen::Map<Vector6d>{residual} = whitening_ * transform_error(error);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    write_padded<6>(whitening_ * error_by_left(error), jacobians[0]);
  }
  return true;
}

}  // namespace hybrid_slam
