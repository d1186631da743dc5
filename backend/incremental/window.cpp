#include <ceres/cost_function.h>

#include <algorithm>
#include <numeric>

#include "backend/incremental/incremental_solver.h"

// How an IncrementalSolver lets go of old poses.

namespace hybrid_slam {

namespace {

// Poses as columns of a linear system, six each.
class Columns {
 public:
  void add(std::uint32_t pose) {
    if (!contains(pose)) poses_.push_back(pose);
  }
  bool contains(std::uint32_t pose) const {
    return std::find(poses_.begin(), poses_.end(), pose) != poses_.end();
  }
  Eigen::Index column(std::uint32_t pose) const {
    return 6 * (std::find(poses_.begin(), poses_.end(), pose) - poses_.begin());
  }
  Eigen::Index count() const { return static_cast<Eigen::Index>(6 * poses_.size()); }
  const std::vector<std::uint32_t>& poses() const { return poses_; }

 private:
  std::vector<std::uint32_t> poses_;
};

// The rows of a term over its own poses.
LinearSystem rows_of(const EdgeTerm& edge) {
  LinearSystem rows{Eigen::MatrixXd(6, 6 * edge.variable), edge.residual};
  for (std::size_t i = 0; i < edge.variable; ++i) {
    rows.jacobian.middleCols<6>(static_cast<Eigen::Index>(6 * i)) = edge.by_pose[i];
  }
  return rows;
}

// Without the landmark. Views that are not usable leave zeros.
LinearSystem rows_of(const LandmarkTerm& landmark) {
  const auto views = static_cast<Eigen::Index>(landmark.views.size());
  const auto poses = static_cast<Eigen::Index>(landmark.poses.size());
  LinearSystem rows{Eigen::MatrixXd::Zero(3 * views, 3 + 6 * poses),
                    Eigen::VectorXd::Zero(3 * views)};
  for (Eigen::Index i = 0; i < views; ++i) {
    const LandmarkView& view = landmark.views[static_cast<std::size_t>(i)];
    if (view.usable) {
      rows.jacobian.block<3, 3>(3 * i, 0) = view.by_point;
      rows.residual.segment<3>(3 * i) = view.residual;
      if (view.fixed) continue;
      const auto pose = std::find(landmark.poses.begin(), landmark.poses.end(), view.pose);
      const Eigen::Index column = 3 + 6 * (pose - landmark.poses.begin());
      rows.jacobian.block<3, 6>(3 * i, column) = view.by_pose;
    }
  }
  return marginalize(rows, 3);
}

}  // namespace

LinearSystem IncrementalSolver::rows_of_term(std::uint32_t id) const {
  const Term& term = terms_[id];
  switch (term.kind) {
    case TermKind::kEdge:
      return rows_of(edge_terms_[term.index]);
    case TermKind::kLandmark:
      return rows_of(landmarks_[term.index]);
    case TermKind::kPrior:
      break;
  }
  return priors_[term.index].rows;
}

// Linearises the terms at the present estimate, minimises the poses and the landmarks they see out
// of them, and puts what that leaves on other poses in their place.
void IncrementalSolver::marginalize_poses(const std::vector<std::uint32_t>& poses) {
  std::vector<std::uint32_t> ids;
  for (const std::uint32_t pose : poses) {
    ids.insert(ids.end(), poses_[pose].terms.begin(), poses_[pose].terms.end());
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  Columns columns;
  for (const std::uint32_t pose : poses) columns.add(pose);
  std::vector<LinearSystem> systems;
  Eigen::Index row_count = 0;
  for (const std::uint32_t id : ids) {
    linearize(id);
    systems.push_back(rows_of_term(id));
    row_count += systems.back().residual.size();
    for (const std::uint32_t pose : poses_of(id)) columns.add(pose);
  }

  LinearSystem all{Eigen::MatrixXd::Zero(row_count, columns.count()), Eigen::VectorXd(row_count)};
  Eigen::Index row = 0;
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const Eigen::Index rows = systems[k].residual.size();
    const auto members = poses_of(ids[k]);
    for (std::size_t i = 0; i < members.size(); ++i) {
      all.jacobian.block(row, columns.column(members[i]), rows, 6) =
          systems[k].jacobian.middleCols(static_cast<Eigen::Index>(6 * i), 6);
    }
    all.residual.segment(row, rows) = systems[k].residual;
    row += rows;
  }
  PriorTerm prior;
  prior.poses.assign(columns.poses().begin() + static_cast<std::ptrdiff_t>(poses.size()),
                     columns.poses().end());
  prior.rows = marginalize(all, static_cast<Eigen::Index>(6 * poses.size()));
  for (const std::uint32_t id : ids) drop_term(id);
  for (const std::uint32_t pose : poses) {
    fold(pose);
    poses_[pose].fixed = true;
  }
  if (prior.rows.residual.size() > 0) add_prior(std::move(prior));
}

void IncrementalSolver::add_prior(PriorTerm prior) {
  priors_.push_back(std::move(prior));
  const std::uint32_t id =
      add_term(TermKind::kPrior, static_cast<std::uint32_t>(priors_.size()) - 1);
  for (const std::uint32_t pose : poses_of(id)) {
    poses_[pose].terms.push_back(id);
    touched_.push_back(pose);
  }
  terms_[id].cost = evaluate_prior(terms_[id].index).cost;
}

// The term's information has gone elsewhere. A landmark stays where it is, as if newly made.
void IncrementalSolver::drop_term(std::uint32_t id) {
  Term& term = terms_[id];
  for (const std::uint32_t pose : poses_of(id)) {
    touched_.push_back(pose);
    std::erase(poses_[pose].terms, id);
  }
  squared_norm_ -= term.squared_norm;
  rows_ -= term.rows;
  mismatch_ -= term.mismatch;
  term.squared_norm = term.mismatch = term.cost = 0;
  term.rows = 0;
  if (term.kind == TermKind::kEdge) {
    edge_there_[term.index] = 0;
    edge_factors_[term.index].reset();
    edge_terms_[term.index].variable = 0;
  } else if (term.kind == TermKind::kPrior) {
    priors_[term.index] = {};
  } else {
    LandmarkTerm& landmark = landmarks_[term.index];
    for (const LandmarkView& view : landmark.views) {
      observation_there_[view.observation] = 0;
      observation_factors_[view.observation].reset();
      free_observations_.push_back(view.observation);
    }
    LandmarkTerm renewed;
    renewed.base = point(term.index);
    landmark = std::move(renewed);
  }
}

// Returns the poses that left.
std::vector<std::uint32_t> IncrementalSolver::slide_window() {
  const auto window = static_cast<std::size_t>(options_.window);
  // Several at once: what they see together is taken apart once.
  const std::size_t slack = std::max<std::size_t>(1, window / 10);
  std::vector<std::uint32_t> active;
  for (std::uint32_t i = oldest_; i < poses_.size(); ++i) {
    if (!poses_[i].fixed) active.push_back(i);
  }
  if (window == 0 || active.size() < window + slack) return {};
  active.resize(active.size() - window);
  marginalize_poses(active);
  oldest_ = active.back() + 1;
  return active;
}

}  // namespace hybrid_slam
