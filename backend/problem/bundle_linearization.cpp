#include <ceres/cost_function.h>

#include <cmath>
#include <limits>

#include "backend/problem/bundle_equations.h"
#include "factors/camera_reprojection.h"

namespace hybrid_slam {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kPoseStride = 7;  // of derivatives by a pose: see factors/manifolds.h

bool evaluate_term(const FactorGraph& graph, const BundleTerm& term, const BundleEstimate& at,
                   std::uint32_t p, double* residual, double* by_pose, double* by_point) {
  return camera_reprojection_residual(
      graph.cameras[term.camera].camera, at.cam_from_world[term.frame].params.data(),
      at.point_in_world[p].data(), term.measurement, term.sigma, residual, by_pose, by_point);
}

bool evaluate_edge(const FactorGraph& graph, const GraphFactors& factors, std::uint32_t index,
                   const BundleEstimate& at, Vector6d& residual, double** by_poses) {
  const GraphEdge& edge = graph.edges[index];
  const double* poses[] = {at.cam_from_world[edge.a].params.data(),
                           at.cam_from_world[edge.b].params.data()};
  return factors.edges[index]->Evaluate(poses, residual.data(), by_poses);
}

double finite(double cost) { return std::isfinite(cost) ? cost : kInfinity; }

}  // namespace

BundleEquations::BundleEquations(const FactorGraph& graph, const GraphFactors& factors,
                                 const BundleStructure& structure, const BundleLosses& losses)
    : graph_(graph),
      factors_(factors),
      structure_(structure),
      losses_(losses),
      pose_information_(static_cast<std::size_t>(structure.rows())),
      pose_gradient_(6 * structure.rows()),
      point_information_(structure.varying_points),
      point_gradient_(3 * Eigen::Index{structure.varying_points}),
      cross_(structure.view_count),
      halves_(structure.varying_points),
      reduced_(structure.pattern),
      reduced_right_(6 * structure.rows()) {
  const auto row = [&](std::uint32_t frame) { return structure.pattern.row(frame); };
  for (const std::uint32_t i : structure.edges) {
    edge_blocks_.push_back({row(graph.edges[i].a), row(graph.edges[i].b), Matrix6d::Zero()});
  }
  find_blocks();
}

double BundleEquations::cost(const BundleEstimate& at) const {
  double sum = edges_cost(at);
  double residual[3] = {};
  for (std::uint32_t p = 0; p < structure_.points.size(); ++p) {
    for (std::uint32_t i = structure_.first_terms[p]; i < structure_.first_terms[p + 1]; ++i) {
      const BundleTerm& term = structure_.terms[i];
      if (!evaluate_term(graph_, term, at, p, residual, nullptr, nullptr)) return kInfinity;
      double square = residual[0] * residual[0] + residual[1] * residual[1];
      const bool two_rows = std::isnan(term.measurement[2]);
      if (!two_rows) square += residual[2] * residual[2];
      sum += (two_rows ? losses_.mono : losses_.stereo).cost(square) / 2;
    }
  }
  return finite(sum);
}

double BundleEquations::edges_cost(const BundleEstimate& at) const {
  double sum = 0;
  Vector6d residual;
  for (const std::uint32_t i : structure_.edges) {
    if (!evaluate_edge(graph_, factors_, i, at, residual, nullptr)) return kInfinity;
    const double square = residual.squaredNorm();
    sum += (graph_.edges[i].loop ? losses_.loop.cost(square) : square) / 2;
  }
  return sum;
}

double BundleEquations::linearize(const BundleEstimate& at) {
  for (Matrix6d& information : pose_information_) information.setZero();
  pose_gradient_.setZero();
  double sum = linearize_edges(at);
  for (std::uint32_t p = 0; p < structure_.points.size(); ++p) sum += linearize_point(p, at);
  return finite(sum);
}

double BundleEquations::linearize_edges(const BundleEstimate& at) {
  double sum = 0;
  Vector6d residual;
  Eigen::Matrix<double, 6, kPoseStride, Eigen::RowMajor> by_a;
  Eigen::Matrix<double, 6, kPoseStride, Eigen::RowMajor> by_b;
  double* by_poses[] = {by_a.data(), by_b.data()};
  for (std::size_t k = 0; k < structure_.edges.size(); ++k) {
    const std::uint32_t i = structure_.edges[k];
    if (!evaluate_edge(graph_, factors_, i, at, residual, by_poses)) return kInfinity;
    const RobustLoss loss = graph_.edges[i].loop ? losses_.loop : RobustLoss();
    sum += loss.cost(residual.squaredNorm()) / 2;
    const double root_weight = loss.root_weight(residual.squaredNorm());
    residual *= root_weight;
    const Matrix6d a = root_weight * by_a.leftCols<6>();
    const Matrix6d b = root_weight * by_b.leftCols<6>();
    EdgeBlock& block = edge_blocks_[k];
    const auto add = [&](int row, const Matrix6d& jacobian) {
      if (row == BlockPattern::kNone) return;
      pose_information_[static_cast<std::size_t>(row)].noalias() += jacobian.transpose() * jacobian;
      pose_gradient_.segment<6>(6 * Eigen::Index{row}).noalias() += jacobian.transpose() * residual;
    };
    add(block.row_a, a);
    add(block.row_b, b);
    block.by_both.noalias() = a.transpose() * b;
  }
  return sum;
}

double BundleEquations::linearize_point(std::uint32_t p, const BundleEstimate& at) {
  double residual[3] = {};
  double by_pose[3 * kPoseStride];
  double by_point[9];
  if (p < structure_.varying_points) {
    point_information_[p].setZero();
    point_gradient_.segment<3>(3 * Eigen::Index{p}).setZero();
  }
  double sum = 0;
  std::uint32_t view = BundleTerm::kNoView;
  for (std::uint32_t i = structure_.first_terms[p]; i < structure_.first_terms[p + 1]; ++i) {
    const BundleTerm& term = structure_.terms[i];
    if (!evaluate_term(graph_, term, at, p, residual, by_pose, by_point)) return kInfinity;
    const bool again = term.view == view;
    view = term.view;
    sum += std::isnan(term.measurement[2])
               ? add_term<2>(term, p, again, residual, by_pose, by_point)
               : add_term<3>(term, p, again, residual, by_pose, by_point);
  }
  return sum;
}

template <int kRows>
double BundleEquations::add_term(const BundleTerm& term, std::uint32_t p, bool again,
                                 double* residual_data, double* by_pose_data,
                                 double* by_point_data) {
  Eigen::Map<Eigen::Matrix<double, kRows, 1>> residual(residual_data);
  Eigen::Map<Eigen::Matrix<double, kRows, kPoseStride, Eigen::RowMajor>> padded(by_pose_data);
  Eigen::Map<Eigen::Matrix<double, kRows, 3, Eigen::RowMajor>> by_point(by_point_data);
  const RobustLoss& loss = kRows == 2 ? losses_.mono : losses_.stereo;
  const double square = residual.squaredNorm();
  const double root_weight = loss.root_weight(square);
  if (root_weight != 1) {
    residual *= root_weight;
    padded *= root_weight;
    by_point *= root_weight;
  }
  const auto by_pose = padded.template leftCols<6>();
  if (term.row != BlockPattern::kNone) {
    pose_information_[static_cast<std::size_t>(term.row)].noalias() +=
        by_pose.transpose() * by_pose;
    pose_gradient_.segment<6>(6 * Eigen::Index{term.row}).noalias() +=
        by_pose.transpose() * residual;
  }
  if (p < structure_.varying_points) {
    point_information_[p].noalias() += by_point.transpose() * by_point;
    point_gradient_.segment<3>(3 * Eigen::Index{p}).noalias() += by_point.transpose() * residual;
  }
  if (term.view == BundleTerm::kNoView) return loss.cost(square) / 2;
  if (again) {
    cross_[term.view].noalias() += by_pose.transpose() * by_point;
  } else {
    cross_[term.view].noalias() = by_pose.transpose() * by_point;
  }
  return loss.cost(square) / 2;
}

}  // namespace hybrid_slam
