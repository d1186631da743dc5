#include <ceres/cost_function.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "backend/incremental/incremental_solver.h"

// A step of an IncrementalSolver, and what becomes of it if it would raise the cost.

namespace hybrid_slam {

namespace {

// A pose's damping, in parts of the information that its terms give it: at first, and how it grows
// and falls from one attempt to the next. Below kLeastDamping it does not count.
constexpr double kFirstDamping = 1e-2;
constexpr double kDampingFactor = 30;
constexpr double kLeastDamping = 1e-3;
constexpr int kAttempts = 8;

// Mean squared residual below which measurements count as perfect.
constexpr double kNoResidual = 1e-12;

// How often a landmark's displacement is cut in half before it is left where it was.
constexpr int kCuts = 10;

}  // namespace

void IncrementalSolver::step(UpdateSummary& summary) {
  const std::vector<std::uint32_t> linearized = std::exchange(dirty_, {});
  relax_damping();
  for (const std::uint32_t term : linearized) {
    linearize(term);
    terms_[term].dirty = false;
    const auto poses = poses_of(term);
    touched_.insert(touched_.end(), poses.begin(), poses.end());
  }
  ++step_;
  ++summary.steps;
  rise_ = 0;
  judged_.clear();
  solve_step(summary, linearized);
  bool is_bad = is_higher();
  if (is_bad) {
    hold_landmarks_back();
    is_bad = is_higher();
    for (int attempt = 0; is_bad && attempt < kAttempts; ++attempt) {
      raise_damping();
      undo_step();
      solve_step(summary, std::vector<std::uint32_t>(judged_));
      if (is_higher()) hold_landmarks_back();
      is_bad = is_higher();
    }
    ++(is_bad ? summary.refused : summary.damped);
  }
  if (is_bad) {
    undo_step();
    check(std::vector<std::uint32_t>(judged_), {});
    hold_landmarks_back();
  }
  for (const Moved& moved : moved_) summary.moved.push_back(variables_[moved.variable].index);
  for (const MovedBlock& moved : moved_blocks_) {
    summary.moved_blocks.push_back(variables_[moved.variable].index);
  }
  moved_.clear();
  moved_blocks_.clear();
  for (const std::uint32_t landmark : held_back_) {
    // What was displaced by a part will be displaced further. The others wait for a change.
    if (!displacement(*landmarks_[landmark]).isZero(0)) mark_dirty(landmark_terms_[landmark]);
  }
  held_back_.clear();
}

// Factors, solves, and measures what that does to the terms: these, and those of what moved.
void IncrementalSolver::solve_step(UpdateSummary& summary,
                                   const std::vector<std::uint32_t>& terms) {
  if (!touched_.empty()) {
    tree_.refactor(touched_, newest_, *this);
    touched_.clear();
    summary.poses += tree_.last_poses();
    summary.multiplications += tree_.last_cost();
    summary.undetermined = std::max(summary.undetermined, tree_.last_undetermined());
  }
  std::vector<std::uint32_t> moved;
  tree_.solve(options_.wildfire, moved);
  for (const std::uint32_t variable : moved) {
    if (variables_[variable].is_block) {
      const Block& block = blocks_[variables_[variable].index];
      moved_blocks_.push_back({variable, block.inner, block.folded_delta, block.basis});
    } else {
      const Pose& pose = pose_with(variable);
      moved_.push_back({variable, pose.folded, pose.folded_delta});
    }
    fold(variable);
  }
  check(terms, moved);
}

// Back to where the step began. Terms keep what they were evaluated to, until the next check.
void IncrementalSolver::undo_step() {
  tree_.undo_solve();
  for (const Moved& moved : moved_) {
    pose_with(moved.variable).folded = moved.folded;
    pose_with(moved.variable).folded_delta = moved.folded_delta;
  }
  for (MovedBlock& moved : moved_blocks_) {
    Block& block = blocks_[variables_[moved.variable].index];
    block.inner = std::move(moved.inner);
    block.folded_delta = std::move(moved.folded_delta);
    block.basis = std::move(moved.basis);
  }
  moved_.clear();
  moved_blocks_.clear();
  for (const std::uint32_t landmark : held_back_) landmarks_[landmark]->held_back.setZero();
  held_back_.clear();
}

// Whether the step raised the cost by more than linearisations may be off: a difference m in the
// residuals r changes |r|^2 by up to 2 |r| |m|, and |m|^2 may be `relinearization` times |r|^2.
bool IncrementalSolver::is_higher() const {
  if (rise_ <= 0) return false;
  double squared_norm = 0;
  for (const std::uint32_t id : judged_) {
    squared_norm += std::max(terms_[id].squared_norm, kNoResidual * terms_[id].rows);
  }
  const double allowed = 2 * std::sqrt(options_.relinearization);
  return !(rise_ <= allowed * squared_norm);
}

// Landmarks whose own cost rose are displaced by less: each by itself, since the poses are given.
void IncrementalSolver::hold_landmarks_back() {
  for (const std::uint32_t id : std::vector<std::uint32_t>(judged_)) {
    const Term& term = terms_[id];
    if (term.kind != TermKind::kLandmark || !(term.cost > term.start_cost)) continue;
    LandmarkTerm& landmark = *landmarks_[term.index];
    if (!landmark.solvable) continue;
    const Eigen::Vector3d full = displacement(landmark);
    double best_cost = term.cost;
    Eigen::Vector3d best = Eigen::Vector3d::Zero();
    for (int i = 1; i <= kCuts + 1; ++i) {
      const double part = i <= kCuts ? std::ldexp(1.0, -i) : 0;
      landmark.held_back = (1 - part) * full;
      const double cost = evaluate_landmark(term.index).cost;
      if (!(cost < best_cost)) continue;
      best_cost = cost;
      best = landmark.held_back;
      if (best_cost <= term.start_cost) break;
    }
    landmark.held_back = best;
    if (best.isZero(0)) continue;
    held_back_.push_back(term.index);
    evaluate(id);
  }
}

// Of the poses of the terms that are farthest from what their linearisations predict or, if there
// are none, of all that moved.
void IncrementalSolver::raise_damping() {
  const double worst = options_.worst_mismatch * options_.worst_mismatch * typical();
  std::vector<std::uint32_t> poses;
  for (const std::uint32_t id : judged_) {
    const Term& term = terms_[id];
    if (!(term.mismatch > worst * term.rows) || !(term.cost > term.start_cost)) continue;
    const auto members = poses_of(id);
    poses.insert(poses.end(), members.begin(), members.end());
  }
  if (poses.empty()) {
    for (const Moved& moved : moved_) poses.push_back(moved.variable);
    for (const MovedBlock& moved : moved_blocks_) poses.push_back(moved.variable);
  }
  std::sort(poses.begin(), poses.end());
  poses.erase(std::unique(poses.begin(), poses.end()), poses.end());
  for (const std::uint32_t pose : poses) {
    double& damping = variables_[pose].damping;
    if (damping == 0) damped_.push_back(pose);
    damping = std::max(kFirstDamping, kDampingFactor * damping);
    tree_.set_damping(pose, damping);
    touched_.push_back(pose);
  }
}

// A step that was damped is followed by one that is less so.
void IncrementalSolver::relax_damping() {
  for (const std::uint32_t pose : damped_) {
    double& damping = variables_[pose].damping;
    damping /= kDampingFactor;
    if (damping < kLeastDamping || variables_[pose].fixed) damping = 0;
    tree_.set_damping(pose, damping);
    if (!variables_[pose].fixed) touched_.push_back(pose);
  }
  std::erase_if(damped_, [this](std::uint32_t pose) { return variables_[pose].damping == 0; });
}

}  // namespace hybrid_slam
