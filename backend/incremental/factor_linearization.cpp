#include <ceres/cost_function.h>

#include <algorithm>
#include <cmath>

#include "backend/incremental/incremental_solver.h"

// What an IncrementalSolver asks its factors of any kind, and its priors.

namespace hybrid_slam {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Squared mismatch of a factor whose function fails.
constexpr double kNoResult = 1e6;

}  // namespace

// The values of a factor's variables, in its order.
struct IncrementalSolver::Arguments {
  std::vector<double> values;
  std::vector<const double*> blocks;
};

IncrementalSolver::Arguments IncrementalSolver::arguments(const Factor& factor,
                                                          const Eigen::Vector3d* at) const {
  Arguments result;
  const auto append = [&](const auto& values) {
    result.values.insert(result.values.end(), values.data(), values.data() + values.size());
  };
  for (const GraphVariable& variable : factor.given.variables) {
    if (variable.kind == GraphVariable::Kind::kPose) append(pose(variable.index).params);
    if (variable.kind == GraphVariable::Kind::kPoint) append(*at);
    if (variable.kind == GraphVariable::Kind::kBlock) append(block(variable.index));
  }
  const double* next = result.values.data();
  for (const int size : factor.function->parameter_block_sizes()) {
    result.blocks.push_back(next);
    next += size;
  }
  return result;
}

bool IncrementalSolver::factor_residual(const Factor& factor, const Eigen::Vector3d* at,
                                        Eigen::VectorXd& residual) const {
  residual.setZero(factor.function->num_residuals());
  const Arguments given = arguments(factor, at);
  return factor.function->Evaluate(given.blocks.data(), residual.data(), nullptr) &&
         residual.allFinite();
}

bool IncrementalSolver::linearize_factor(const Factor& factor, const Eigen::Vector3d* at,
                                         const std::vector<std::uint32_t>& variables,
                                         const std::vector<Eigen::Index>& offsets,
                                         LinearSystem& rows,
                                         Eigen::Matrix<double, Eigen::Dynamic, 3>* by_point,
                                         double& cost) const {
  const int count = factor.function->num_residuals();
  const std::vector<int>& sizes = factor.function->parameter_block_sizes();
  const Arguments given = arguments(factor, at);
  std::vector<RowMajor> by_argument;
  std::vector<double*> jacobians;
  by_argument.reserve(sizes.size());
  for (const int size : sizes) {
    jacobians.push_back(by_argument.emplace_back(count, size).data());
  }
  rows.residual.setZero(count);
  rows.jacobian.setZero(count, offsets.back());
  if (!factor.function->Evaluate(given.blocks.data(), rows.residual.data(), jacobians.data()) ||
      !rows.residual.allFinite()) {
    return false;
  }
  const auto column_of = [&](std::uint32_t variable) -> Eigen::Index {
    const auto found = std::find(variables.begin(), variables.end(), variable);
    return found == variables.end() ? -1
                                    : offsets[static_cast<std::size_t>(found - variables.begin())];
  };
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    if (!by_argument[k].allFinite()) return false;
    const GraphVariable& variable = factor.given.variables[k];
    if (variable.kind == GraphVariable::Kind::kPoint) {
      *by_point = by_argument[k];
    } else if (variable.kind == GraphVariable::Kind::kPose) {
      const Pose& pose = poses_[variable.index];
      const Eigen::Index column = column_of(pose.variable);
      if (column < 0) continue;
      const Eigen::Matrix<double, Eigen::Dynamic, 6> by_left = by_argument[k].leftCols<6>();
      rows.jacobian.middleCols<6>(column) +=
          pose.tangent.from_left(by_left, pose_at(pose.variable));
    } else {
      const Block& block = blocks_[variable.index];
      const Eigen::Index column = column_of(block.variable);
      if (column < 0) continue;  // fixed
      const Eigen::Map<const Eigen::VectorXd> value(given.blocks[k], sizes[k]);
      const Eigen::MatrixXd by_value = by_argument[k];
      rows.jacobian.middleCols(column, block.tangent_size()) +=
          block.by_increment(by_value, carrier_rotation(block));
      const Eigen::Index by_carrier =
          block.given.world_vectors.empty() ? -1 : column_of(block.carrier);
      if (by_carrier >= 0) {
        rows.jacobian.middleCols<3>(by_carrier + 3) += block.by_turn(by_value, value);
      }
    }
  }
  const RobustLoss loss{factor.given.loss, factor.given.threshold};
  const double squared = rows.residual.squaredNorm();
  const double weight = loss.root_weight(squared);
  cost += loss.cost(squared);
  rows.residual *= weight;
  rows.jacobian *= weight;
  if (by_point != nullptr) *by_point *= weight;
  for (std::size_t i = 0; i < variables.size(); ++i) {
    rows.residual.noalias() -= rows.jacobian.middleCols(offsets[i], offsets[i + 1] - offsets[i]) *
                               tree_.delta_of(variables[i]);
  }
  return true;
}

double IncrementalSolver::linearize_rows(std::uint32_t index) {
  const Factor& factor = factors_[index];
  RowsTerm& term = factor_terms_[index];
  double cost = 0;
  if (!factor.there || factor.point != kNone) return 0;
  if (!linearize_factor(factor, nullptr, term.variables, term.offsets, term.rows, nullptr, cost)) {
    term.rows = {};
    return 0;
  }
  return cost;
}

IncrementalSolver::Evaluation IncrementalSolver::evaluate_rows(std::uint32_t index) const {
  const Factor& factor = factors_[index];
  const RowsTerm& term = factor_terms_[index];
  if (!factor.there || factor.point != kNone) return {};
  Eigen::VectorXd residual;
  if (!factor_residual(factor, nullptr, residual)) {
    return term.rows.residual.size() == 0
               ? Evaluation{}
               : Evaluation{0, kNoResult, kNoResult, factor.function->num_residuals()};
  }
  Evaluation result;
  result.rows = factor.function->num_residuals();
  if (term.rows.residual.size() == 0) {  // it failed when it was linearised
    result.squared_mismatch = kNoResult;
    return result;
  }
  const RobustLoss loss{factor.given.loss, factor.given.threshold};
  const double squared = residual.squaredNorm();
  result.cost = loss.cost(squared);
  residual *= loss.root_weight(squared);
  result.squared_norm = residual.squaredNorm();
  residual -= term.rows.residual;
  for (std::size_t i = 0; i < term.variables.size(); ++i) {
    residual.noalias() -=
        term.rows.jacobian.middleCols(term.offsets[i], term.offsets[i + 1] - term.offsets[i]) *
        tree_.delta_of(term.variables[i]);
  }
  result.squared_mismatch = residual.squaredNorm();
  return result;
}

void IncrementalSolver::evaluate_factor_view(const FactorView& view, const Eigen::Vector3d& at,
                                             const Eigen::Vector3d& displacement,
                                             Evaluation& result) const {
  if (!view.usable) return;
  const Factor& factor = factors_[view.factor];
  result.rows += factor.function->num_residuals();
  Eigen::VectorXd residual;
  if (!factor_residual(factor, &at, residual)) {
    result.squared_mismatch += kNoResult;
    result.cost += kNoResult;
    return;
  }
  const RobustLoss loss{factor.given.loss, factor.given.threshold};
  const double squared = residual.squaredNorm();
  result.cost += loss.cost(squared);
  residual *= loss.root_weight(squared);
  result.squared_norm += residual.squaredNorm();
  residual -= view.rows.residual;
  residual.noalias() -= view.by_point * displacement;
  for (std::size_t i = 0; i < view.variables.size(); ++i) {
    residual.noalias() -=
        view.rows.jacobian.middleCols(view.offsets[i], view.offsets[i + 1] - view.offsets[i]) *
        tree_.delta_of(view.variables[i]);
  }
  result.squared_mismatch += residual.squaredNorm();
}

IncrementalSolver::Evaluation IncrementalSolver::evaluate_prior(std::uint32_t index) const {
  const RowsTerm& prior = priors_[index].active;
  if (prior.variables.empty()) return {};
  Eigen::VectorXd residual = prior.rows.residual;
  for (std::size_t i = 0; i < prior.variables.size(); ++i) {
    residual.noalias() +=
        prior.rows.jacobian.middleCols(prior.offsets[i], prior.offsets[i + 1] - prior.offsets[i]) *
        tree_.delta_of(prior.variables[i]);
  }
  Evaluation result;  // never off its linearisation, and no measure of the others' residuals
  result.cost = residual.squaredNorm();
  return result;
}

}  // namespace hybrid_slam
