#pragma once

#include <vector>

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include "test/support/jacobian_check.h"

namespace hybrid_slam {

// One parameter block of a factor under test: its value, and the manifold it moves on (null: adds).
struct FactorBlock {
  Eigen::VectorXd value;
  const ceres::Manifold* manifold = nullptr;

  Eigen::Index tangent_size() const {
    return manifold == nullptr ? value.size() : manifold->TangentSize();
  }
  Eigen::VectorXd moved(const Eigen::VectorXd& delta) const {
    if (manifold == nullptr) return value + delta;
    Eigen::VectorXd result(value.size());
    manifold->Plus(value.data(), delta.data(), result.data());
    return result;
  }
};

struct FactorEvaluation {
  bool ok = false;
  Eigen::VectorXd residual;
  std::vector<RowMajorMatrix> jacobians;  // by each block's own coordinates, as the factor wrote
};

inline FactorEvaluation evaluate(const ceres::CostFunction& factor,
                                 const std::vector<FactorBlock>& blocks) {
  FactorEvaluation result;
  result.residual = Eigen::VectorXd::Zero(factor.num_residuals());
  std::vector<const double*> values;
  std::vector<double*> jacobians;
  for (const FactorBlock& block : blocks) {
    values.push_back(block.value.data());
    result.jacobians.push_back(RowMajorMatrix::Constant(factor.num_residuals(), block.value.size(),
                                                        std::numeric_limits<double>::quiet_NaN()));
  }
  for (RowMajorMatrix& jacobian : result.jacobians) jacobians.push_back(jacobian.data());
  result.ok = factor.Evaluate(values.data(), result.residual.data(), jacobians.data());
  return result;
}

inline Eigen::VectorXd residual_of(const ceres::CostFunction& factor,
                                   const std::vector<FactorBlock>& blocks) {
  Eigen::VectorXd residual(factor.num_residuals());
  std::vector<const double*> values;
  for (const FactorBlock& block : blocks) values.push_back(block.value.data());
  if (!factor.Evaluate(values.data(), residual.data(), nullptr)) {
    residual.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return residual;
}

// d residual / d tangent of block i, as a solver sees it: the factor's Jacobian times the lift.
inline RowMajorMatrix lifted_jacobian(const FactorEvaluation& evaluation,
                                      const std::vector<FactorBlock>& blocks, std::size_t i) {
  if (blocks[i].manifold == nullptr) return evaluation.jacobians[i];
  RowMajorMatrix lift(blocks[i].value.size(), blocks[i].tangent_size());
  blocks[i].manifold->PlusJacobian(blocks[i].value.data(), lift.data());
  return evaluation.jacobians[i] * lift;
}

// The worst jacobian_mismatch over the blocks between what the factor says and numeric differences
// of its residual along each manifold: about 1e-8 if it is right, 1e-3 and more if it is not.
inline double factor_mismatch(const ceres::CostFunction& factor,
                              const std::vector<FactorBlock>& blocks, double step = 1e-3) {
  const FactorEvaluation evaluation = evaluate(factor, blocks);
  if (!evaluation.ok) return std::numeric_limits<double>::infinity();
  if ((residual_of(factor, blocks) - evaluation.residual).norm() > 1e-9) {
    return std::numeric_limits<double>::infinity();
  }
  double worst = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const auto along_block = [&](const Eigen::VectorXd& delta) -> Eigen::VectorXd {
      std::vector<FactorBlock> moved = blocks;
      moved[i].value = blocks[i].moved(delta);
      return residual_of(factor, moved);
    };
    const RowMajorMatrix numeric =
        numeric_jacobian(along_block, Eigen::VectorXd::Zero(blocks[i].tangent_size()), step);
    worst = std::max(worst, jacobian_mismatch(lifted_jacobian(evaluation, blocks, i), numeric));
  }
  return worst;
}

}  // namespace hybrid_slam
