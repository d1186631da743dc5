#include "factors/linear_prior.h"

#include <ceres/manifold.h>

#include <stdexcept>
#include <utility>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/so3.h"
#include "factors/transform_error.h"

namespace hybrid_slam {

int PriorBlock::tangent_size() const {
  return manifold != nullptr ? manifold->TangentSize() : static_cast<int>(base.size());
}

LinearPrior::LinearPrior(std::vector<Rigid3d> bases, Eigen::MatrixXd jacobian,
                         Eigen::VectorXd residual, std::vector<PriorBlock> blocks)
    : bases_(std::move(bases)),
      others_(std::move(blocks)),
      jacobian_(std::move(jacobian)),
      residual_(std::move(residual)) {
  auto columns = static_cast<Eigen::Index>(6 * bases_.size());
  for (const PriorBlock& block : others_) columns += block.tangent_size();
  if (jacobian_.cols() != columns || jacobian_.rows() != residual_.size() ||
      jacobian_.rows() == 0) {
    throw std::logic_error("LinearPrior: sizes do not agree");
  }
  if (!jacobian_.allFinite() || !residual_.allFinite()) {
    throw std::logic_error("LinearPrior: values must be finite");
  }
  set_num_residuals(static_cast<int>(residual_.size()));
  mutable_parameter_block_sizes()->assign(bases_.size(), 7);
  for (const PriorBlock& block : others_) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(block.base.size()));
  }
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
  for (std::size_t k = 0; k < others_.size(); ++k) add_block(k, blocks, out, jacobians);
  return true;
}

void LinearPrior::add_block(std::size_t k, const double* const* blocks,
                            Eigen::Map<Eigen::VectorXd>& residual, double** jacobians) const {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const PriorBlock& block = others_[k];
  const std::size_t at = bases_.size() + k;
  auto column = static_cast<Eigen::Index>(6 * bases_.size());
  for (std::size_t i = 0; i < k; ++i) column += others_[i].tangent_size();
  Eigen::MatrixXd by_value = jacobian_.middleCols(column, block.tangent_size());

  Eigen::VectorXd value = Eigen::Map<const Eigen::VectorXd>(blocks[at], block.base.size());
  const bool rides = block.carrier >= 0;
  const Eigen::Matrix3d rotation =
      rides ? from_block<Rigid3d>(blocks[block.carrier]).rotation().toRotationMatrix()
            : block.known_rotation;
  for (const int start : block.world_vectors) {
    value.segment<3>(start) = (rotation * value.segment<3>(start)).eval();
  }
  Eigen::VectorXd difference = value - block.base;
  if (block.manifold != nullptr) {
    difference.resize(block.tangent_size());
    block.manifold->Minus(value.data(), block.base.data(), difference.data());
    RowMajor minus(block.tangent_size(), value.size());
    block.manifold->MinusJacobian(value.data(), minus.data());
    by_value = (by_value * minus).eval();
  }
  residual.noalias() += jacobian_.middleCols(column, block.tangent_size()) * difference;
  if (jacobians == nullptr) return;
  // A left perturbation of the carrier, R <- exp(turn) R, turns the value by itself.
  if (rides && jacobians[block.carrier] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>> by_pose(
        jacobians[block.carrier], residual_.size(), 7);
    for (const int start : block.world_vectors) {
      by_pose.middleCols<3>(3) -=
          by_value.middleCols<3>(start) * hat(Eigen::Vector3d(value.segment<3>(start)));
    }
  }
  if (jacobians[at] == nullptr) return;
  for (const int start : block.world_vectors) {
    by_value.middleCols<3>(start) = (by_value.middleCols<3>(start) * rotation).eval();
  }
  Eigen::Map<RowMajor>(jacobians[at], residual_.size(), value.size()) = by_value;
}

}  // namespace hybrid_slam
