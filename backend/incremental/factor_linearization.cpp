#include <ceres/cost_function.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "backend/incremental/incremental_solver.h"
#include "backend/incremental/scratch.h"

// What an IncrementalSolver asks its factors of any kind, and its priors.

namespace hybrid_slam {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Squared mismatch of a factor whose function fails.
constexpr double kNoResult = 1e6;

// Of a factor that is not unusually large: its variables and their numbers, its rows, and all
// numbers of its Jacobians.
constexpr std::size_t kVariables = 8;
constexpr std::size_t kNumbers = 48;
constexpr std::size_t kRows = 16;
constexpr std::size_t kDerivatives = 512;

std::size_t sum_of(const std::vector<int>& sizes) {
  return static_cast<std::size_t>(std::accumulate(sizes.begin(), sizes.end(), 0));
}

// residual -= columns * delta: few rows, which a general product would spend most of its time on.
void subtract(const Eigen::MatrixXd& jacobian, Eigen::Index first,
              const Eigen::Map<const Eigen::VectorXd>& delta,
              Eigen::Ref<Eigen::VectorXd> residual) {
  for (Eigen::Index i = 0; i < delta.size(); ++i) residual -= delta[i] * jacobian.col(first + i);
}

}  // namespace

// The values of a factor's variables, in its order.
class IncrementalSolver::Arguments {
 public:
  Arguments(const IncrementalSolver& solver, const Factor& factor, const Eigen::Vector3d* point)
      : values_(sum_of(factor.function->parameter_block_sizes())),
        blocks_(factor.given.variables.size()) {
    double* next = values_.data();
    const double** block = blocks_.data();
    for (const GraphVariable& variable : factor.given.variables) {
      *block++ = next;
      next = solver.write_value(variable, point, next);
    }
  }

  const double* const* blocks() const { return blocks_.data(); }

 private:
  Scratch<double, kNumbers> values_;
  Scratch<const double*, kVariables> blocks_;
};

// Returns where the next value goes.
double* IncrementalSolver::write_value(const GraphVariable& variable, const Eigen::Vector3d* point,
                                       double* to) const {
  if (variable.kind == GraphVariable::Kind::kPoint) {
    return std::copy_n(point->data(), 3, to);
  }
  if (variable.kind == GraphVariable::Kind::kPose) {
    const Rigid3d pose = pose_at(poses_[variable.index].variable);
    return std::copy_n(pose.params.data(), pose.params.size(), to);
  }
  const Block& block = blocks_[variable.index];
  const auto size = block.inner.size();
  if (variables_[block.variable].fixed) return std::copy_n(block.given.values.data(), size, to);
  block.write(tree_.delta_of(block.variable), carrier_rotation(block), to);
  return to + size;
}

bool IncrementalSolver::factor_residual(const Factor& factor, const Eigen::Vector3d* at,
                                        Eigen::Ref<Eigen::VectorXd> residual) const {
  residual.setZero();
  const Arguments given(*this, factor, at);
  return factor.function->Evaluate(given.blocks(), residual.data(), nullptr) &&
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
  const Arguments given(*this, factor, at);
  Scratch<double, kDerivatives> derivatives(static_cast<std::size_t>(count) * sum_of(sizes));
  Scratch<double*, kVariables> jacobians(sizes.size());
  double* next = derivatives.data();
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    jacobians.data()[k] = next;
    next += std::ptrdiff_t{count} * sizes[k];
  }
  rows.residual.setZero(count);
  rows.jacobian.setZero(count, offsets.back());
  if (!factor.function->Evaluate(given.blocks(), rows.residual.data(), jacobians.data()) ||
      !rows.residual.allFinite()) {
    return false;
  }
  const auto column_of = [&](std::uint32_t variable) -> Eigen::Index {
    const auto found = std::find(variables.begin(), variables.end(), variable);
    return found == variables.end() ? -1
                                    : offsets[static_cast<std::size_t>(found - variables.begin())];
  };
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    Eigen::Map<RowMajor> by_value(jacobians.data()[k], count, sizes[k]);
    if (!by_value.allFinite()) return false;
    const GraphVariable& variable = factor.given.variables[k];
    if (variable.kind == GraphVariable::Kind::kPoint) {
      *by_point = by_value;
    } else if (variable.kind == GraphVariable::Kind::kPose) {
      const Pose& pose = poses_[variable.index];
      const Eigen::Index column = column_of(pose.variable);
      if (column < 0) continue;
      const Matrix6d by_increment = pose.tangent.from_origin(adjoint(pose_at(pose.variable)));
      for (int row = 0; row < count; ++row) {
        rows.jacobian.block<1, 6>(row, column) += by_value.block<1, 6>(row, 0) * by_increment;
      }
    } else {
      const Block& block = blocks_[variable.index];
      const Eigen::Index column = column_of(block.variable);
      if (column < 0) continue;  // fixed
      if (!block.given.world_vectors.empty()) {
        const Eigen::Index by_carrier = column_of(block.carrier);
        const Eigen::Map<const Eigen::VectorXd> value(given.blocks()[k], sizes[k]);
        if (by_carrier >= 0) {
          block.add_by_turn(by_value, value, rows.jacobian.middleCols<3>(by_carrier + 3));
        }
        block.turn(by_value, carrier_rotation(block));
      }
      block.add_by_increment(by_value, rows.jacobian.middleCols(column, block.tangent_size()));
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
    subtract(rows.jacobian, offsets[i], tree_.delta_of(variables[i]), rows.residual);
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
  Scratch<double, kRows> scratch(static_cast<std::size_t>(factor.function->num_residuals()));
  Eigen::Map<Eigen::VectorXd> residual(scratch.data(), factor.function->num_residuals());
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
    subtract(term.rows.jacobian, term.offsets[i], tree_.delta_of(term.variables[i]), residual);
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
  Scratch<double, kRows> scratch(static_cast<std::size_t>(factor.function->num_residuals()));
  Eigen::Map<Eigen::VectorXd> residual(scratch.data(), factor.function->num_residuals());
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
  for (Eigen::Index i = 0; i < 3; ++i) residual -= displacement[i] * view.by_point.col(i);
  for (std::size_t i = 0; i < view.variables.size(); ++i) {
    subtract(view.rows.jacobian, view.offsets[i], tree_.delta_of(view.variables[i]), residual);
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
