#include <ceres/cost_function.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "backend/incremental/incremental_solver.h"
#include "cameras/geometry/so3.h"

// Covariances of an IncrementalSolver's variables, from those of its deltas.

namespace hybrid_slam {

// How a variable differs with the deltas of the tree's variables, and by how much it varies where
// they are known: d = sum_i by_delta_i delta_i + noise.
struct IncrementalSolver::Dependence {
  std::vector<std::uint32_t> on;
  std::vector<Eigen::MatrixXd> by_delta;
  Eigen::MatrixXd own;  // covariance of the noise
};

IncrementalSolver::Dependence IncrementalSolver::dependence_of(const GraphVariable& given) const {
  Dependence result;
  const VariableSize found = size_of(given);
  if (found.fault != nullptr) {
    throw std::logic_error("IncrementalSolver::covariance: variable " +
                           std::to_string(given.index) + " " + found.fault);
  }
  if (given.kind == GraphVariable::Kind::kPose) {
    const Pose& pose = poses_[given.index];
    result.own = Matrix6d::Zero();
    if (variables_[pose.variable].fixed) return result;
    // The left perturbation that an increment is.
    result.on.push_back(pose.variable);
    result.by_delta.push_back(
        pose.tangent.from_left(Matrix6d(Matrix6d::Identity()), pose_at(pose.variable)));
  } else if (given.kind == GraphVariable::Kind::kBlock) {
    const Block& block = blocks_[given.index];
    const Eigen::Index size = block.inner.size();
    result.own = Eigen::MatrixXd::Zero(size, size);
    if (variables_[block.variable].fixed) return result;
    const Block::Rows identity = Block::Rows::Identity(size, size);
    Block::Rows by_inner = identity;
    block.turn(by_inner, carrier_rotation(block));
    Eigen::MatrixXd by_increment = Eigen::MatrixXd::Zero(size, block.tangent_size());
    block.add_by_increment(by_inner, by_increment);
    result.on.push_back(block.variable);
    result.by_delta.push_back(std::move(by_increment));
    if (block.given.world_vectors.empty() || variables_[block.carrier].fixed) return result;
    Eigen::MatrixXd by_carrier = Eigen::MatrixXd::Zero(size, 6);
    const Eigen::VectorXd values = this->block(given.index);
    block.add_by_turn(identity, {values.data(), size}, by_carrier.rightCols<3>());
    result.on.push_back(block.carrier);
    result.by_delta.push_back(std::move(by_carrier));
  } else {
    // d = -L^-T (U^T delta), and V^-1 = L^-T L^-1 around it.
    std::optional<LandmarkTerm> condensed;
    if (condensed_in_[given.index] != kNone) condensed = linearized_landmark(given.index);
    const LandmarkTerm& landmark = condensed ? *condensed : *landmarks_[given.index];
    if (!landmark.solvable) {
      result.own = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
      return result;
    }
    const Eigen::Matrix3d root = landmark.factor.transpose().triangularView<Eigen::Upper>().solve(
        Eigen::Matrix3d::Identity());
    result.own = root * root.transpose();
    for (const LandmarkView& view : landmark.views) {
      if (!view.usable || view.fixed) continue;
      result.on.push_back(view.pose);
      result.by_delta.push_back(-root * view.reduced.transpose());
    }
    for (const FactorView& view : landmark.factors) {
      for (std::size_t i = 0; view.usable && i < view.variables.size(); ++i) {
        const Eigen::Index rows = view.offsets[i + 1] - view.offsets[i];
        result.on.push_back(view.variables[i]);
        result.by_delta.push_back(-root *
                                  view.reduced.middleRows(view.offsets[i], rows).transpose());
      }
    }
  }
  return result;
}

IncrementalSolver::PosePaths IncrementalSolver::paths(const std::vector<std::uint32_t>& poses,
                                                      std::size_t most) const {
  std::vector<std::uint32_t> wanted;
  for (const std::uint32_t pose : poses) wanted.push_back(poses_.at(pose).variable);
  PosePaths result;
  result.paths = tree_.paths(wanted, most);
  for (std::uint32_t at = 0; at < result.paths.variables.size(); ++at) {
    const std::uint32_t variable = result.paths.variables[at];
    if (variables_[variable].is_block) continue;
    const Matrix6d identity = Matrix6d::Identity();
    result.poses.push_back({variables_[variable].index, at,
                            pose_with(variable).tangent.from_left(identity, pose_at(variable))});
  }
  std::sort(result.poses.begin(), result.poses.end(),
            [](const auto& a, const auto& b) { return a.pose < b.pose; });
  return result;
}

Matrix6d IncrementalSolver::covariance(std::uint32_t pose) const {
  return covariance({pose_variable(pose)});
}

Eigen::MatrixXd IncrementalSolver::covariance(const std::vector<GraphVariable>& variables) const {
  std::vector<Dependence> dependences;
  std::vector<std::uint32_t> on;
  Eigen::Index rows = 0;
  for (const GraphVariable& variable : variables) {
    dependences.push_back(dependence_of(variable));
    on.insert(on.end(), dependences.back().on.begin(), dependences.back().on.end());
    rows += dependences.back().own.rows();
  }
  std::sort(on.begin(), on.end());
  on.erase(std::unique(on.begin(), on.end()), on.end());
  std::vector<Eigen::Index> column(1, 0);
  for (const std::uint32_t variable : on) column.push_back(column.back() + tree_.size(variable));
  Eigen::MatrixXd by_deltas = Eigen::MatrixXd::Zero(rows, column.back());
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::Index row = 0;
  for (const Dependence& dependence : dependences) {
    const Eigen::Index size = dependence.own.rows();
    own.block(row, row, size, size) = dependence.own;
    for (std::size_t i = 0; i < dependence.on.size(); ++i) {
      const auto at = std::lower_bound(on.begin(), on.end(), dependence.on[i]) - on.begin();
      const Eigen::MatrixXd& by_delta = dependence.by_delta[i];
      by_deltas.block(row, column[static_cast<std::size_t>(at)], size, by_delta.cols()) += by_delta;
    }
    row += size;
  }
  return by_deltas * tree_.covariance(on) * by_deltas.transpose() + own;
}

}  // namespace hybrid_slam
