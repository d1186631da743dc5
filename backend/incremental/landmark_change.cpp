#include <cmath>

#include "backend/incremental/incremental_solver.h"

// Whether anything has changed for a landmark with factors of any kind since it was evaluated last.
// What several poses have in common of a motion is no change for what they see, however far it is:
// after each new pose all of a long path bends a little, and next to nothing of it is news.

namespace hybrid_slam {

namespace {

// A change of a term's residuals, in standard deviations and by its derivatives, that needs no
// evaluation: what it leaves out of the linearisation is of second order, and by a turn t of a view
// that sees it a thousand times as strongly it is 1e-4.
// Where linearisations may be off by less, so may this: it is 0.3 where they may by 1e-4 of the
// cost.
constexpr double kNoChange = 30;

}  // namespace

// How strongly the residuals change by each component of its variables, and by a motion that they
// all have in common, at the place of the anchor: by nothing, where all that it knows are poses.
void IncrementalSolver::note_reach(LandmarkTerm& landmark) const {
  std::size_t size = 0;
  for (const std::uint32_t v : landmark.poses) size += static_cast<std::size_t>(tree_.size(v));
  if (!landmark.change) landmark.change = std::make_unique<LandmarkChange>();
  std::vector<float>& all = landmark.change->reach;
  all.assign(size + 6, 0);
  landmark.change->evaluated_at.assign(size, 0);
  if (landmark.anchor == LandmarkTerm::kNoAnchor) return;
  const Eigen::Vector3d place = pose_with(landmark.anchor).tangent.place;
  Vector6d in_common = Vector6d::Zero();
  Eigen::Matrix<double, Eigen::Dynamic, 6> common;
  const auto add = [&](std::uint32_t variable, const auto& jacobian) {
    float* reach = all.data();
    for (const std::uint32_t v : landmark.poses) {
      if (v == variable) break;
      reach += tree_.size(v);
    }
    for (Eigen::Index i = 0; i < jacobian.cols(); ++i) {
      reach[i] += static_cast<float>(jacobian.col(i).squaredNorm());
    }
    if (variables_[variable].is_block) return;
    common += jacobian;
    common.template rightCols<3>() +=
        jacobian.template leftCols<3>() * hat(place - pose_with(variable).tangent.place);
  };
  const auto begin = [&](const auto& by_point) {
    common.resize(by_point.rows(), 6);
    common.template leftCols<3>() = -by_point;
    common.template rightCols<3>() = by_point * hat(landmark.base - place);
  };
  for (const LandmarkView& view : landmark.views) {
    if (!view.usable) continue;
    begin(view.by_point);
    if (!view.fixed) add(view.pose, view.by_pose);
    in_common += common.colwise().squaredNorm().transpose();
  }
  for (const FactorView& view : landmark.factors) {
    if (!view.usable) continue;
    begin(view.by_point);
    for (std::size_t i = 0; i < view.variables.size(); ++i) {
      add(view.variables[i],
          view.rows.jacobian.middleCols(view.offsets[i], view.offsets[i + 1] - view.offsets[i]));
    }
    in_common += common.colwise().squaredNorm().transpose();
  }
  for (Eigen::Index i = 0; i < 6; ++i) {
    all[size + static_cast<std::size_t>(i)] = static_cast<float>(in_common[i]);
  }
  for (float& reach : all) reach = std::sqrt(reach);
}

void IncrementalSolver::note_evaluated(LandmarkTerm& landmark) const {
  float* to = landmark.change->evaluated_at.data();
  for (const std::uint32_t v : landmark.poses) {
    for (const double value : tree_.delta_of(v)) *to++ = static_cast<float>(value);
  }
}

// Of a term of another kind it is not known.
bool IncrementalSolver::has_changed(const Term& term) const {
  if (term.dirty) return true;
  if (term.kind == TermKind::kCondensed) return has_changed(condensed_[term.index]);
  if (term.kind != TermKind::kLandmark) return true;
  const LandmarkTerm& landmark = *landmarks_[term.index];
  return landmark.factors.empty() || has_changed(landmark);
}

bool IncrementalSolver::has_changed(const LandmarkTerm& landmark) const {
  if (landmark.anchor == LandmarkTerm::kNoAnchor) return true;
  const Eigen::Vector3d place = pose_with(landmark.anchor).tangent.place;
  const float* before = landmark.change->evaluated_at.data();
  for (const std::uint32_t v : landmark.poses) {
    if (v == landmark.anchor) break;
    before += tree_.size(v);
  }
  const Vector6d common = tree_.delta(landmark.anchor) -
                          Eigen::Map<const Eigen::Matrix<float, 6, 1>>(before).cast<double>();
  const float* reach = landmark.change->reach.data();
  before = landmark.change->evaluated_at.data();
  const double allowed = kNoChange * std::sqrt(options_.relinearization);
  double change = 0;
  for (const std::uint32_t v : landmark.poses) {
    const auto delta = tree_.delta_of(v);
    if (variables_[v].is_block) {
      for (Eigen::Index i = 0; i < delta.size(); ++i) {
        change += reach[i] * std::abs(delta[i] - before[i]);
      }
    } else if (v != landmark.anchor) {
      Vector6d own = tree_.delta(v) -
                     Eigen::Map<const Eigen::Matrix<float, 6, 1>>(before).cast<double>() - common;
      own.head<3>() += (pose_with(v).tangent.place - place).cross(common.tail<3>());
      for (Eigen::Index i = 0; i < 6; ++i) change += reach[i] * std::abs(own[i]);
    }
    reach += delta.size();
    before += delta.size();
    if (change > allowed) return true;
  }
  for (Eigen::Index i = 0; i < 6; ++i) change += reach[i] * std::abs(common[i]);
  return change > allowed;
}

}  // namespace hybrid_slam
