#include <ceres/cost_function.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "backend/incremental/incremental_solver.h"
#include "backend/incremental/scratch.h"
#include "factors/camera_reprojection.h"

// What an IncrementalSolver asks its terms: their linearisation at the present estimate, and how
// far the present estimate is from it.

namespace hybrid_slam {

namespace {

// Squared mismatch of an observation that does not project any more.
constexpr double kFarOff = 1e6;

// How often the step of a point is cut in half before it is given up.
constexpr int kHalvings = 10;

}  // namespace

void IncrementalSolver::linearize(std::uint32_t term) {
  Term& t = terms_[term];
  if (t.kind == TermKind::kEdge) {
    t.cost = linearize_edge(t.index);
  } else if (t.kind == TermKind::kLandmark) {
    t.cost = linearize_landmark(t.index);
  } else if (t.kind == TermKind::kFactor) {
    t.cost = linearize_rows(t.index);
  } else if (t.kind == TermKind::kCondensed) {
    t.cost = linearize_condensed(t.index);
  }
}

RobustLoss IncrementalSolver::edge_loss(std::uint32_t index) const {
  return {edges_[index].loop ? options_.loop_loss : Loss::kNone, options_.chi2_loop};
}

RobustLoss IncrementalSolver::view_loss(std::uint32_t observation) const {
  return loss_of_rows(rows_of_observation(observation));
}

RobustLoss IncrementalSolver::loss_of_rows(int rows) const {
  return {options_.loss, rows == 3 ? options_.chi2_stereo : options_.chi2_mono};
}

double IncrementalSolver::linearize_edge(std::uint32_t index) {
  if (edge_there_[index] == 0) return 0;
  const GraphEdge& edge = edges_[index];
  const Rigid3d a = pose(edge.a);
  const Rigid3d b = pose(edge.b);
  const double* blocks[] = {a.params.data(), b.params.data()};
  double by_a[42];
  double by_b[42];
  double* jacobians[] = {by_a, by_b};
  EdgeTerm& term = edge_terms_[index];
  edge_factors_[index]->Evaluate(blocks, term.residual.data(), jacobians);
  const RobustLoss loss = edge_loss(index);
  const double squared = term.residual.squaredNorm();
  const double weight = loss.root_weight(squared);
  term.residual *= weight;
  using RowMajor67 = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>;
  std::size_t k = 0;
  for (const auto& [pose, jacobian] : {std::pair(edge.a, by_a), std::pair(edge.b, by_b)}) {
    const std::uint32_t variable = poses_[pose].variable;
    if (variables_[variable].fixed) continue;
    const Vector6d at = tree_.delta(variable);
    const Matrix6d by_left = weight * Eigen::Map<const RowMajor67>(jacobian).leftCols<6>();
    term.by_pose[k] = poses_[pose].tangent.from_left(by_left, pose == edge.a ? a : b);
    term.residual.noalias() -= term.by_pose[k] * at;
    ++k;
  }
  return loss.cost(squared);
}

bool IncrementalSolver::reproject(std::uint32_t observation, const Rigid3d& cam_from_world,
                                  const Eigen::Vector3d& point, double* residual, double* d_pose,
                                  double* d_point) const {
  const Seen& seen = observations_[observation];
  return camera_reprojection_residual(
      cameras_[poses_[seen.frame].camera], cam_from_world.params.data(), point.data(),
      seen.measurement.cast<double>(), seen.sigma, residual, d_pose, d_point);
}

int IncrementalSolver::rows_of_observation(std::uint32_t observation) const {
  const Seen& seen = observations_[observation];
  return reprojection_rows(cameras_[poses_[seen.frame].camera], seen.measurement.cast<double>());
}

bool IncrementalSolver::linearize_view(const Eigen::Vector3d& point, LandmarkView& view,
                                       double& cost) const {
  const Rigid3d cam_from_world = pose_at(view.pose);
  Eigen::Matrix<double, 3, 7, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_point;
  by_pose.row(2).setZero();
  by_point.row(2).setZero();
  view.residual.setZero();
  if (!reproject(view.observation, cam_from_world, point, view.residual.data(), by_pose.data(),
                 by_point.data())) {
    return false;
  }
  const RobustLoss loss = view_loss(view.observation);
  const double squared = view.residual.squaredNorm();
  cost += loss.cost(squared);
  const double weight = loss.root_weight(squared);
  view.residual *= weight;
  view.by_point = weight * by_point;
  if (!view.fixed) {
    const Eigen::Matrix<double, 3, 6> by_left = weight * by_pose.leftCols<6>();
    view.by_pose = pose_with(view.pose).tangent.from_left(by_left, cam_from_world);
    view.residual.noalias() -= view.by_pose * tree_.delta(view.pose);
  }
  return true;
}

double IncrementalSolver::linearize_landmark(std::uint32_t index) {
  return linearize(*landmarks_[index], point(index));
}

// Of a landmark that need not be part of the graph. `wanted`: where, if that is possible.
double IncrementalSolver::linearize(LandmarkTerm& landmark, const Eigen::Vector3d& wanted) const {
  const Eigen::Vector3d start = carried_base(landmark);
  Eigen::Vector3d step = wanted - start;
  if (!step.allFinite()) step.setZero();
  const std::size_t count = landmark.views.size();
  Scratch<char, 64> had(count + landmark.factors.size());
  for (std::size_t i = 0; i < count; ++i) had.data()[i] = landmark.views[i].usable ? 1 : 0;
  for (std::size_t i = 0; i < landmark.factors.size(); ++i) {
    had.data()[count + i] = landmark.factors[i].usable ? 1 : 0;
  }
  double cost = 0;
  const auto linearize_at = [&](const Eigen::Vector3d& at) {
    bool all = true;
    cost = 0;
    for (std::size_t i = 0; i < count; ++i) {
      LandmarkView& view = landmark.views[i];
      view.usable = linearize_view(at, view, cost);
      all = all && (view.usable || had.data()[i] == 0);
    }
    for (std::size_t i = 0; i < landmark.factors.size(); ++i) {
      FactorView& view = landmark.factors[i];
      view.usable = linearize_factor(factors_[view.factor], &at, view.variables, view.offsets,
                                     view.rows, &view.by_point, cost);
      all = all && (view.usable || had.data()[count + i] == 0);
    }
    return all;
  };
  // A step that takes the point out of a view which had it is too long.
  bool fits = linearize_at(start + step);
  for (int i = 0; i < kHalvings && !fits; ++i) {
    step *= 0.5;
    fits = linearize_at(start + step);
  }
  if (!fits) {
    step.setZero();
    linearize_at(start);
  }
  landmark.base = start + step;
  landmark.held_back.setZero();
  landmark.anchor = LandmarkTerm::kNoAnchor;
  const auto anchor = std::find_if(landmark.poses.begin(), landmark.poses.end(),
                                   [this](std::uint32_t v) { return !variables_[v].is_block; });
  if (anchor != landmark.poses.end()) {
    landmark.anchor = *anchor;
    landmark.in_anchor = pose_at(landmark.anchor) * landmark.base;
    landmark.anchor_delta = tree_.delta(landmark.anchor);
  }
  landmark.eliminate();
  if (!landmark.factors.empty()) note_reach(landmark);
  return landmark.solvable ? cost : 0;
}

Vector6d IncrementalSolver::edge_residual(std::uint32_t index) const {
  const Rigid3d a = pose(edges_[index].a);
  const Rigid3d b = pose(edges_[index].b);
  const double* blocks[] = {a.params.data(), b.params.data()};
  Vector6d residual;
  edge_factors_[index]->Evaluate(blocks, residual.data(), nullptr);
  return residual;
}

IncrementalSolver::Evaluation IncrementalSolver::evaluate_edge(std::uint32_t index) const {
  if (edge_there_[index] == 0) return {};
  const EdgeTerm& term = edge_terms_[index];
  Vector6d residual = edge_residual(index);
  const RobustLoss loss = edge_loss(index);
  const double squared = residual.squaredNorm();
  residual *= loss.root_weight(squared);
  Vector6d difference = residual - term.residual;
  for (std::size_t k = 0; k < term.variable; ++k) {
    difference.noalias() -= term.by_pose[k] * tree_.delta(term.poses[k]);
  }
  return {residual.squaredNorm(), difference.squaredNorm(), loss.cost(squared), 6};
}

IncrementalSolver::Evaluation IncrementalSolver::evaluate_landmark(std::uint32_t index) const {
  const LandmarkTerm& landmark = *landmarks_[index];
  Evaluation result;
  if (!landmark.solvable) return result;
  const Eigen::Vector3d by_point = displacement(landmark);
  const Eigen::Vector3d at = displaced(landmark, by_point);
  for (const LandmarkView& view : landmark.views) {
    if (!view.usable) continue;
    const Rigid3d cam_from_world = pose_at(view.pose);
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    const int rows = rows_of_observation(view.observation);
    result.rows += rows;
    if (!reproject(view.observation, cam_from_world, at, residual.data())) {
      result.squared_mismatch += kFarOff;
      result.cost += kFarOff;
      continue;
    }
    const RobustLoss loss = loss_of_rows(rows);
    const double squared = residual.squaredNorm();
    result.cost += loss.cost(squared);
    residual *= loss.root_weight(squared);
    result.squared_norm += residual.squaredNorm();
    residual -= view.residual + view.by_point * by_point;
    if (!view.fixed) residual.noalias() -= view.by_pose * tree_.delta(view.pose);
    result.squared_mismatch += residual.squaredNorm();
  }
  for (const FactorView& view : landmark.factors) evaluate_factor_view(view, at, by_point, result);
  return result;
}

double IncrementalSolver::chi2(std::uint32_t observation) const {
  if (observation_there_.at(observation) == 0) {
    throw std::logic_error("IncrementalSolver::chi2: no such observation");
  }
  const Seen& seen = observations_[observation];
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  if (!reproject(observation, pose(seen.frame), point(seen.point), residual.data())) {
    return std::numeric_limits<double>::infinity();
  }
  return residual.squaredNorm();
}

void IncrementalSolver::evaluate(std::uint32_t id) {
  Term& term = terms_[id];
  Evaluation at;
  if (term.kind == TermKind::kEdge) at = evaluate_edge(term.index);
  if (term.kind == TermKind::kLandmark) {
    at = evaluate_landmark(term.index);
    LandmarkTerm& landmark = *landmarks_[term.index];
    if (!landmark.factors.empty() && !term.dirty) note_evaluated(landmark);
  }
  if (term.kind == TermKind::kPrior) at = evaluate_prior(term.index);
  if (term.kind == TermKind::kFactor) at = evaluate_rows(term.index);
  if (term.kind == TermKind::kCondensed) at = evaluate_condensed(term.index);
  if (!std::isfinite(at.cost) || !std::isfinite(at.squared_mismatch)) {
    at = {0, kFarOff, kFarOff, at.rows};
  }
  if (term.step != step_) {
    term.step = step_;
    term.start_cost = term.cost;
    judged_.push_back(id);
  }
  evaluated_ += static_cast<std::size_t>(at.rows);
  rise_ += at.cost - term.cost;
  term.cost = at.cost;
  squared_norm_ += at.squared_norm - term.squared_norm;
  rows_ += at.rows - term.rows;
  mismatch_ += at.squared_mismatch - term.mismatch;
  term.squared_norm = at.squared_norm;
  term.rows = at.rows;
  term.mismatch = at.squared_mismatch;
}

}  // namespace hybrid_slam
