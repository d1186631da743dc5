#include <ceres/cost_function.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "backend/incremental/incremental_solver.h"

// What an IncrementalSolver asks its terms: their linearisation at the present estimate, and how
// far the present estimate is from it.

namespace hybrid_slam {

namespace {

// Squared mismatch of an observation that does not project any more.
constexpr double kFarOff = 1e6;

// The square root of the weight that a loss gives a term.
double robust_weight(Loss loss, double threshold, double squared) {
  if (loss == Loss::kCauchy) return std::sqrt(1 / (1 + squared / threshold));
  if (loss == Loss::kHuber && squared > threshold) return std::pow(threshold / squared, 0.25);
  return 1;
}

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

double IncrementalSolver::edge_weight(std::uint32_t index, const Vector6d& residual) const {
  const Loss loss = edges_[index].loop ? options_.loop_loss : Loss::kNone;
  return robust_weight(loss, options_.chi2_loop, residual.squaredNorm());
}

double IncrementalSolver::view_weight(const LandmarkView& view,
                                      const Eigen::Vector3d& residual) const {
  const bool stereo = observation_factors_[view.observation]->num_residuals() == 3;
  return robust_weight(options_.loss, stereo ? options_.chi2_stereo : options_.chi2_mono,
                       residual.squaredNorm());
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
  const double weight = edge_weight(index, term.residual);
  term.residual *= weight;
  using RowMajor67 = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>;
  std::size_t k = 0;
  for (const auto& [pose, jacobian] : {std::pair(edge.a, by_a), std::pair(edge.b, by_b)}) {
    if (poses_[pose].fixed) continue;
    const Vector6d& at = tree_.delta(pose);
    const Matrix6d by_left = weight * Eigen::Map<const RowMajor67>(jacobian).leftCols<6>();
    term.by_pose[k] = poses_[pose].tangent.from_left(by_left, pose == edge.a ? a : b);
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
  const double weight = view_weight(view, view.residual);
  view.residual *= weight;
  view.by_point = weight * by_point;
  if (!view.fixed) {
    const Eigen::Matrix<double, 3, 6> by_left = weight * by_pose.leftCols<6>();
    view.by_pose = poses_[view.pose].tangent.from_left(by_left, cam_from_world);
    view.residual.noalias() -= view.by_pose * tree_.delta(view.pose);
  }
  return true;
}

void IncrementalSolver::linearize_landmark(std::uint32_t index) {
  LandmarkTerm& landmark = landmarks_[index];
  const Eigen::Vector3d start = carried_base(landmark);
  Eigen::Vector3d step = point(index) - start;
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
  landmark.views = std::move(views);
  landmark.anchor = LandmarkTerm::kNoAnchor;
  if (!landmark.poses.empty()) {
    landmark.anchor = landmark.poses.front();
    landmark.in_anchor = pose(landmark.anchor) * landmark.base;
    landmark.anchor_delta = tree_.delta(landmark.anchor);
  }
  landmark.eliminate();
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
  residual *= edge_weight(index, residual);
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
  const Eigen::Vector3d at = point(index);
  const Eigen::Vector3d by_point = displacement(landmark);
  for (const LandmarkView& view : landmark.views) {
    if (!view.usable) continue;
    const Rigid3d cam_from_world = pose(view.pose);
    const double* blocks[] = {cam_from_world.params.data(), at.data()};
    const ceres::CostFunction& factor = *observation_factors_[view.observation];
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    result.rows += factor.num_residuals();
    if (!factor.Evaluate(blocks, residual.data(), nullptr)) {
      result.squared_mismatch += kFarOff;
      continue;
    }
    residual *= view_weight(view, residual);
    result.squared_norm += residual.squaredNorm();
    residual -= view.residual + view.by_point * by_point;
    if (!view.fixed) residual.noalias() -= view.by_pose * tree_.delta(view.pose);
    result.squared_mismatch += residual.squaredNorm();
  }
  return result;
}

double IncrementalSolver::chi2(std::uint32_t observation) const {
  if (observation_there_.at(observation) == 0) {
    throw std::logic_error("IncrementalSolver::chi2: no such observation");
  }
  const GraphObservation& seen = observations_[observation];
  const ceres::CostFunction& factor = *observation_factors_[observation];
  const Rigid3d cam_from_world = pose(seen.frame);
  const Eigen::Vector3d at = point(seen.point);
  const double* blocks[] = {cam_from_world.params.data(), at.data()};
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  if (!factor.Evaluate(blocks, residual.data(), nullptr)) {
    return std::numeric_limits<double>::infinity();
  }
  return residual.squaredNorm();
}

double IncrementalSolver::cost() const {
  double sum = 0;
  for (std::uint32_t i = 0; i < edges_.size(); ++i) {
    if (edge_there_[i] != 0) sum += edge_residual(i).squaredNorm();
  }
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
