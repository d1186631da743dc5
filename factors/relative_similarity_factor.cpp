#include "factors/relative_similarity_factor.h"

#include "factors/transform_error.h"
#include "factors/whitening.h"

namespace hybrid_slam {

RelativeSimilarityFactor::RelativeSimilarityFactor(const Sim3d& measured_a_from_b,
                                                   const Matrix7d& information)
    : measured_b_from_a_(inverse(measured_a_from_b)), whitening_(whitening_of(information)) {}

// Jacobians as in RelativePoseFactor.
bool RelativeSimilarityFactor::Evaluate(const double* const* blocks, double* residual,
                                        double** jacobians) const {
  const Sim3d a_from_world = from_block<Sim3d>(blocks[0]);
  const Sim3d b_from_world = from_block<Sim3d>(blocks[1]);
  if (!(a_from_world.scale() > 0) || !(b_from_world.scale() > 0)) return false;
  const Sim3d error = measured_b_from_a_ * a_from_world * inverse(b_from_world);
  Eigen::Map<Vector7d>{residual} = whitening_ * transform_error(error);
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) {
    write_padded<7>(whitening_ * error_by_left(error) * adjoint(measured_b_from_a_), jacobians[0]);
  }
  if (jacobians[1] != nullptr) {
    write_padded<7>(-whitening_ * error_by_right(error), jacobians[1]);
  }
  return true;
}

}  // namespace hybrid_slam
