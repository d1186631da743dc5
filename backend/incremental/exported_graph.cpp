#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <algorithm>
#include <utility>

#include "backend/incremental/incremental_solver.h"

// What an IncrementalSolver holds, for others, and what that costs.

namespace hybrid_slam {

FactorGraph IncrementalSolver::graph() const {
  FactorGraph graph;
  for (const Camera& camera : cameras_) graph.cameras.push_back({camera, 0});
  for (std::uint32_t i = 0; i < poses_.size(); ++i) {
    graph.frames.push_back({pose(i), poses_[i].camera, variables_[poses_[i].variable].fixed});
  }
  for (std::uint32_t i = 0; i < landmarks_.size(); ++i) graph.points.push_back({point(i), false});
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    if (observation_there_[i] != 0) graph.observations.push_back(observations_[i].given());
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    if (edge_there_[i] != 0) graph.edges.push_back(edges_[i]);
  }
  for (std::uint32_t i = 0; i < blocks_.size(); ++i) {
    graph.blocks.push_back(blocks_[i].given);
    if (blocks_[i].there) graph.blocks.back().values = block(i);
    graph.blocks.back().fixed = variables_[blocks_[i].variable].fixed;
  }
  for (const Factor& factor : factors_) {
    if (factor.there) graph.factors.push_back(factor.given);
  }
  for (const Prior& prior : priors_) {
    if (!prior.active.variables.empty()) graph.priors.push_back(exported(prior.active));
  }
  return graph;
}

// Bases are the present estimate. Poses that blocks ride with come along, with nothing of their
// own.
GraphPrior IncrementalSolver::exported(const RowsTerm& prior) const {
  GraphPrior made;
  made.residual = prior.rows.residual;
  std::vector<Eigen::MatrixXd> by_pose;
  std::vector<Eigen::MatrixXd> by_block;
  std::vector<std::uint32_t> pose_variables;
  const Eigen::Index rows = prior.rows.residual.size();
  const auto columns_of = [&](std::size_t k) {
    return prior.rows.jacobian.middleCols(prior.offsets[k],
                                          prior.offsets[k + 1] - prior.offsets[k]);
  };
  for (std::size_t k = 0; k < prior.variables.size(); ++k) {
    const std::uint32_t v = prior.variables[k];
    made.residual += columns_of(k) * tree_.delta_of(v);
    if (variables_[v].is_block) continue;
    made.frames.push_back(variables_[v].index);
    made.bases.push_back(pose_at(v));
    pose_variables.push_back(v);
    const Eigen::Matrix<double, Eigen::Dynamic, 6> by_increment = columns_of(k);
    by_pose.push_back(pose_with(v).tangent.to_origin(by_increment));
  }
  for (std::size_t k = 0; k < prior.variables.size(); ++k) {
    const std::uint32_t v = prior.variables[k];
    if (!variables_[v].is_block) continue;
    const Block& block = blocks_[variables_[v].index];
    PriorBlock base;
    base.base = block.inner_at(tree_.delta_of(v));
    base.manifold = block.given.manifold;
    base.world_vectors = block.given.world_vectors;
    Eigen::MatrixXd by_tangent = columns_of(k);
    if (base.manifold != nullptr) {
      // From coordinates along the block's basis to those of the manifold at the base.
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> minus(
          base.manifold->TangentSize(), base.base.size());
      base.manifold->MinusJacobian(base.base.data(), minus.data());
      by_tangent = by_tangent * (minus * block.basis).inverse();
    }
    if (!base.world_vectors.empty()) {
      base.known_rotation = carrier_rotation(block);
      if (!variables_[block.carrier].fixed) {
        auto at = std::find(pose_variables.begin(), pose_variables.end(), block.carrier);
        if (at == pose_variables.end()) {
          made.frames.push_back(variables_[block.carrier].index);
          made.bases.push_back(pose_at(block.carrier));
          by_pose.push_back(Eigen::MatrixXd::Zero(rows, 6));
          pose_variables.push_back(block.carrier);
          at = pose_variables.end() - 1;
        }
        base.carrier = static_cast<int>(at - pose_variables.begin());
      }
    }
    made.blocks.push_back(variables_[v].index);
    made.block_bases.push_back(std::move(base));
    by_block.push_back(std::move(by_tangent));
  }
  Eigen::Index count = 0;
  for (const auto& part : by_pose) count += part.cols();
  for (const auto& part : by_block) count += part.cols();
  made.jacobian.resize(rows, count);
  Eigen::Index column = 0;
  for (const auto* parts : {&by_pose, &by_block}) {
    for (const Eigen::MatrixXd& part : *parts) {
      made.jacobian.middleCols(column, part.cols()) = part;
      column += part.cols();
    }
  }
  return made;
}

double IncrementalSolver::cost() const {
  double sum = 0;
  for (std::uint32_t i = 0; i < edges_.size(); ++i) {
    if (edge_there_[i] != 0) sum += edge_residual(i).squaredNorm();
  }
  std::vector<Eigen::Vector3d> points;
  for (std::uint32_t i = 0; i < landmarks_.size(); ++i) {
    points.push_back(point(i));
  }
  for (std::uint32_t i = 0; i < observations_.size(); ++i) {
    if (observation_there_[i] == 0) continue;
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    if (reproject(i, pose(observations_[i].frame), points[observations_[i].point],
                  residual.data())) {
      sum += residual.squaredNorm();
    }
  }
  Eigen::VectorXd residual;
  for (const Factor& factor : factors_) {
    if (!factor.there) continue;
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    if (factor.point != kNone) at = point(factor.point);
    residual.resize(factor.function->num_residuals());
    if (factor_residual(factor, &at, residual)) sum += residual.squaredNorm();
  }
  return sum / 2;
}

}  // namespace hybrid_slam
