#include "factors/linear_prior.h"

#include <stdexcept>
#include <utility>

#include "cameras/geometry/se3.h"
#include "factors/transform_error.h"

namespace hybrid_slam {

LinearPrior::LinearPrior(std::vector<Rigid3d> bases, Eigen::MatrixXd jacobian,
                         Eigen::VectorXd residual)
    : bases_(std::move(bases)), jacobian_(std::move(jacobian)), residual_(std::move(residual)) {
  if (jacobian_.cols() != static_cast<Eigen::Index>(6 * bases_.size()) ||
      jacobian_.rows() != residual_.size() || jacobian_.rows() == 0) {
    throw std::logic_error("LinearPrior: sizes do not agree");
  }
  if (!jacobian_.allFinite() || !residual_.allFinite()) {
    throw std::logic_error("LinearPrior: values must be finite");
  }
  set_num_residuals(static_cast<int>(residual_.size()));
  mutable_parameter_block_sizes()->assign(bases_.size(), 7);
}

bool LinearPrior::Evaluate(const double* const* blocks, double* residual,
                           double** jacobians) const {
  Eigen::Map<Eigen::VectorXd> out(residual, residual_.size());
  out = residual_;
  for (std::size_t i = 0; i < bases_.size(); ++i) {
    const Rigid3d world_from_base = inverse(bases_[i]);
    const Vector6d delta = se3_log(world_from_base * from_block<Rigid3d>(blocks[i]));
    const auto columns = jacobian_.middleCols<6>(static_cast<Eigen::Index>(6 * i));
    out.noalias() += columns * delta;
    if (jacobians == nullptr || jacobians[i] == nullptr) continue;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>> by_pose(
        jacobians[i], residual_.size(), 7);
    by_pose.leftCols<6>() = columns * (se3_left_jacobian_inverse(delta) * adjoint(world_from_base));
    by_pose.col(6).setZero();
  }
  return true;
}

}  // namespace hybrid_slam
