#include "factors/relative_pose_factor.h"

#include "cameras/geometry/se3.h"
#include "factors/transform_error.h"
#include "factors/whitening.h"

namespace hybrid_slam {

RelativePoseFactor::RelativePoseFactor(const Rigid3d& measured_a_from_b,
                                       const Matrix6d& information)
    : measured_b_from_a_(inverse(measured_a_from_b)), whitening_(whitening_of(information)) {}

// With M = measured_b_from_a: moving a by delta turns E into exp(adjoint(M) delta) E, moving b
// turns it into E exp(-delta).
bool RelativePoseFactor::Evaluate(const double* const* blocks, double* residual,
                                  double** jacobians) const {
  const Rigid3d a_from_world = from_block<Rigid3d>(blocks[0]);
  const Rigid3d b_from_world = from_block<Rigid3d>(blocks[1]);
  const Rigid3d error = measured_b_from_a_ * a_from_world * inverse(b_from_world);
  Eigen::Map<Vector6d>{residual} = whitening_ * transform_error(error);
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) {
    write_padded<6>(whitening_ * error_by_left(error) * adjoint(measured_b_from_a_), jacobians[0]);
  }
  if (jacobians[1] != nullptr) {
    write_padded<6>(-whitening_ * error_by_right(error), jacobians[1]);
  }
  return true;
}

}  // namespace hybrid_slam
