#include <ceres/cost_function.h>

#include <cmath>

#include "backend/incremental/chart.h"
#include "backend/incremental/incremental_solver.h"

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
  const Term& t = terms_[term];
  if (t.kind == TermKind::kEdge) {
    linearize_edge(t.index);
  } else if (t.kind == TermKind::kLandmark) {
    linearize_landmark(t.index);
  }
}

void IncrementalSolver::linearize_edge(std::uint32_t index) {
  if (edge_there_[index] == 0) return;
  const GraphEdge& edge = edges_[index];
  const Rigid3d a = pose(edge.a);
  const Rigid3d b = pose(edge.b);
  const double* blocks[] = {a.params.data(), b.params.data()};
  double by_a[42];
  double by_b[42];
  double* jacobians[] = {by_a, by_b};
  EdgeTerm& term = edge_terms_[index];
  edge_factors_[index]->Evaluate(blocks, term.residual.data(), jacobians);
  using RowMajor67 = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>;
  std::size_t k = 0;
  for (const auto& [pose, jacobian] : {std::pair(edge.a, by_a), std::pair(edge.b, by_b)}) {
    if (poses_[pose].fixed) continue;
    const Vector6d& at = tree_.delta(pose);
    const Matrix6d by_left = Eigen::Map<const RowMajor67>(jacobian).leftCols<6>();
    term.by_pose[k] = by_chart<6>(by_left, poses_[pose].base, at);
    term.residual.noalias() -= term.by_pose[k] * at;
    ++k;
  }
}

bool IncrementalSolver::linearize_view(const Eigen::Vector3d& point, LandmarkView& view) const {
  const ceres::CostFunction& factor = *observation_factors_[view.observation];
  const Rigid3d cam_from_world = pose(view.pose);
  const double* blocks[] = {cam_from_world.params.data(), point.data()};
  Eigen::Matrix<double, 3, 7, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_point;
  by_pose.row(2).setZero();
  by_point.row(2).setZero();
  view.residual.setZero();
  double* jacobians[] = {by_pose.data(), by_point.data()};
  if (!factor.Evaluate(blocks, view.residual.data(), jacobians)) return false;
  double weight = 1;
  if (options_.loss != Loss::kNone) {
    const double squared = view.residual.squaredNorm();
    const double threshold =
        factor.num_residuals() == 3 ? options_.chi2_stereo : options_.chi2_mono;
    if (options_.loss == Loss::kCauchy) {
      weight = std::sqrt(1 / (1 + squared / threshold));
    } else if (squared > threshold) {
      weight = std::pow(threshold / squared, 0.25);
    }
  }
  view.weight = weight;
  view.residual *= weight;
  view.by_point = weight * by_point;
  if (!view.fixed) {
    const Vector6d& at = tree_.delta(view.pose);
    const Eigen::Matrix<double, 3, 6> by_left = weight * by_pose.leftCols<6>();
    view.by_pose = by_chart<3>(by_left, poses_[view.pose].base, at);
    view.residual.noalias() -= view.by_pose * at;
  }
  return true;
}

void IncrementalSolver::linearize_landmark(std::uint32_t index) {
  LandmarkTerm& landmark = landmarks_[index];
  Eigen::Vector3d step = point(index) - landmark.base;
  if (!step.allFinite()) step.setZero();
  std::vector<LandmarkView> views = landmark.views;
  const auto linearize_at = [&](const Eigen::Vector3d& at) {
    bool all = true;
    for (std::size_t i = 0; i < views.size(); ++i) {
      views[i].usable = linearize_view(at, views[i]);
      all = all && (views[i].usable || !landmark.views[i].usable);
    }
    return all;
  };
  // A step that takes the point out of a view which had it is too long.
  bool fits = linearize_at(landmark.base + step);
  for (int i = 0; i < kHalvings && !fits; ++i) {
    step *= 0.5;
    fits = linearize_at(landmark.base + step);
  }
  if (!fits) {
    step.setZero();
    linearize_at(landmark.base);
  }
  landmark.base += step;
  landmark.views = std::move(views);
  landmark.eliminate();
}

IncrementalSolver::Evaluation IncrementalSolver::evaluate_edge(std::uint32_t index) const {
  if (edge_there_[index] == 0) return {};
  const GraphEdge& edge = edges_[index];
  const EdgeTerm& term = edge_terms_[index];
  const Rigid3d a = pose(edge.a);
  const Rigid3d b = pose(edge.b);
  const double* blocks[] = {a.params.data(), b.params.data()};
  Vector6d residual;
  edge_factors_[index]->Evaluate(blocks, residual.data(), nullptr);
  Vector6d difference = residual - term.residual;
  for (std::size_t k = 0; k < term.variable; ++k) {
    difference.noalias() -= term.by_pose[k] * tree_.delta(term.poses[k]);
  }
  return {residual.squaredNorm(), difference.squaredNorm(), 6};
}

IncrementalSolver::Evaluation IncrementalSolver::evaluate_landmark(std::uint32_t index) const {
  const LandmarkTerm& landmark = landmarks_[index];
  Evaluation result;
  if (!landmark.solvable) return result;
  const Eigen::Vector3d moved = point(index);
  for (const LandmarkView& view : landmark.views) {
    if (!view.usable) continue;
    const Rigid3d cam_from_world = pose(view.pose);
    const double* blocks[] = {cam_from_world.params.data(), moved.data()};
    const ceres::CostFunction& factor = *observation_factors_[view.observation];
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    result.rows += factor.num_residuals();
    if (!factor.Evaluate(blocks, residual.data(), nullptr)) {
      result.squared_mismatch += kFarOff;
      continue;
    }
    result.squared_norm += residual.squaredNorm();
    residual = view.weight * residual - view.residual - view.by_point * (moved - landmark.base);
    if (!view.fixed) residual.noalias() -= view.by_pose * tree_.delta(view.pose);
    result.squared_mismatch += residual.squaredNorm();
  }
  return result;
}

double IncrementalSolver::cost() const {
  double sum = 0;
  for (std::uint32_t i = 0; i < edges_.size(); ++i) sum += evaluate_edge(i).squared_norm;
  for (std::uint32_t i = 0; i < landmarks_.size(); ++i) {
    const Eigen::Vector3d at = point(i);
    for (const LandmarkView& view : landmarks_[i].views) {
      const Rigid3d cam_from_world = pose(view.pose);
      const double* blocks[] = {cam_from_world.params.data(), at.data()};
      Eigen::Vector3d residual = Eigen::Vector3d::Zero();
      if (observation_factors_[view.observation]->Evaluate(blocks, residual.data(), nullptr)) {
        sum += residual.squaredNorm();
      }
    }
  }
  return sum / 2;
}

void IncrementalSolver::evaluate(std::uint32_t id) {
  Term& term = terms_[id];
  if (term.kind == TermKind::kPrior) return;  // never off its linearisation
  const Evaluation at =
      term.kind == TermKind::kEdge ? evaluate_edge(term.index) : evaluate_landmark(term.index);
  squared_norm_ += at.squared_norm - term.squared_norm;
  rows_ += at.rows - term.rows;
  mismatch_ += at.squared_mismatch - term.mismatch;
  term.squared_norm = at.squared_norm;
  term.rows = at.rows;
  term.mismatch = at.squared_mismatch;
}

}  // namespace hybrid_slam
