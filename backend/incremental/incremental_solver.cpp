#include "backend/incremental/incremental_solver.h"

#include <ceres/cost_function.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace hybrid_slam {

namespace {

// A term's squared mismatch per row that is not worth a thought, as a fraction of the typical
// squared residual times what relinearization allows.
constexpr double kNegligible = 1e-2;

// What may be linearised anew at once while credit is saved for all, in parts of the budget.
constexpr double kCheap = 0.1;

// Terms near the root come by themselves if all else is off by no more than this part of what is
// allowed: so the next steps may add as much again, and more, before all has to come.
constexpr double kLeave = 0.25;

// What is shared is told when it has moved so many times as far as other blocks: that leaves out
// 0.045 of the cost once, and not for each of thousands of blocks.
constexpr double kShared = 3;

// Mean squared residual below which measurements count as perfect.
constexpr double kLeastTypical = 1e-12;

}  // namespace

std::string IncrementalOptions::validate() const {
  if (!(relinearization > 0)) return "relinearization must be positive";
  if (!(worst_mismatch > 0)) return "worst_mismatch must be positive";
  if (window < 0) return "window must not be negative";
  if (condense_after < 0) return "condense_after must not be negative";
  if (!(burst >= 1)) return "burst must be at least 1";
  if (!(wildfire >= 0)) return "wildfire must not be negative";
  if (!(block_wildfire >= 0)) return "block_wildfire must not be negative";
  if (max_steps < 1) return "max_steps must be positive";
  if (!(budget >= 0)) return "budget must not be negative";
  if (!(chi2_mono > 0) || !(chi2_stereo > 0) || !(chi2_loop > 0))
    return "chi2 thresholds must be positive";
  return {};
}

IncrementalSolver::IncrementalSolver(const IncrementalOptions& options)
    : options_(options), tree_([&] {
        PoseTree::Options tree;
        tree.share = options.block_wildfire;
        tree.shared_share = kShared * options.block_wildfire;
        return tree;
      }()) {
  if (const std::string wrong = options.validate(); !wrong.empty()) {
    throw std::invalid_argument("IncrementalOptions: " + wrong);
  }
}

IncrementalSolver::~IncrementalSolver() = default;

std::span<const std::uint32_t> IncrementalSolver::terms_of(std::uint32_t variable) const {
  return variables_[variable].terms;
}

bool IncrementalSolver::has_terms(std::uint32_t variable) const {
  return !variables_[variable].terms.empty() || !variables_[variable].mixed.empty();
}

std::span<const std::uint32_t> IncrementalSolver::poses_of(std::uint32_t term) const {
  const Term& t = terms_[term];
  switch (t.kind) {
    case TermKind::kEdge:
      return {edge_terms_[t.index].poses, edge_terms_[t.index].variable};
    case TermKind::kPrior:
      return priors_[t.index].active.variables;
    case TermKind::kFactor:
      return factor_terms_[t.index].variables;
    case TermKind::kCondensed:
      return condensed_[t.index].poses;
    case TermKind::kLandmark:
      break;
  }
  return landmarks_[t.index]->poses;
}

void IncrementalSolver::assemble(std::uint32_t term, Front& front) const {
  const Term& t = terms_[term];
  switch (t.kind) {
    case TermKind::kEdge:
      return edge_terms_[t.index].assemble(front);
    case TermKind::kPrior:
      return priors_[t.index].active.assemble(front);
    case TermKind::kFactor:
      return factor_terms_[t.index].assemble(front);
    case TermKind::kLandmark:
      return landmarks_[t.index]->assemble(front);
    case TermKind::kCondensed:
      return condensed_[t.index].assemble(front);
  }
}

void IncrementalSolver::mark_dirty(std::uint32_t term) {
  if (terms_[term].dirty) return;
  terms_[term].dirty = true;
  dirty_.push_back(term);
}

Rigid3d IncrementalSolver::pose(std::uint32_t index) const {
  return pose_at(poses_.at(index).variable);
}

Rigid3d IncrementalSolver::pose_at(std::uint32_t variable) const {
  const Pose& pose = pose_with(variable);
  const auto delta = tree_.delta(variable);
  if (variables_[variable].fixed || delta == pose.folded_delta) return pose.folded;
  return pose.tangent.moved(pose.folded, delta - pose.folded_delta);
}

Eigen::Matrix3d IncrementalSolver::carrier_rotation(const Block& block) const {
  if (block.given.world_vectors.empty()) return Eigen::Matrix3d::Identity();
  return pose_at(block.carrier).rotation().toRotationMatrix();
}

Eigen::VectorXd IncrementalSolver::block(std::uint32_t index) const {
  const Block& block = blocks_.at(index);
  if (!block.there) throw std::logic_error("IncrementalSolver::block: was removed");
  if (variables_[block.variable].fixed) return block.given.values;
  Eigen::VectorXd values(block.inner.size());
  block.write(tree_.delta_of(block.variable), carrier_rotation(block), values.data());
  return values;
}

Eigen::Vector3d IncrementalSolver::point(std::uint32_t index) const {
  if (condensed_in_.at(index) != kNone) return condensed_point(index);
  const LandmarkTerm& landmark = *landmarks_[index];
  return landmark.solvable ? displaced(landmark, displacement(landmark)) : carried_base(landmark);
}

// A landmark's place, with its displacement beyond its anchor's motion.
Eigen::Vector3d IncrementalSolver::displaced(const LandmarkTerm& landmark,
                                             const Eigen::Vector3d& displacement) const {
  Eigen::Vector3d at = carried_base(landmark) + displacement;
  if (landmark.anchor != LandmarkTerm::kNoAnchor) {
    at -= pose_with(landmark.anchor)
              .tangent.carried(landmark.base, tree_.delta(landmark.anchor) - landmark.anchor_delta);
  }
  return at;
}

Eigen::Vector3d IncrementalSolver::displacement(const LandmarkTerm& landmark) const {
  return landmark.displacement(
             [this](std::uint32_t pose) { return tree_.delta(pose); },
             [this](std::uint32_t variable) { return tree_.delta_of(variable); }) -
         landmark.held_back;
}

// Where its anchor's motion, in full, took the point since it was linearised.
Eigen::Vector3d IncrementalSolver::carried_base(const LandmarkTerm& landmark) const {
  if (landmark.anchor == LandmarkTerm::kNoAnchor) return landmark.base;
  return inverse(pose_at(landmark.anchor)) * landmark.in_anchor;
}

// Makes the variable's increments since the last time part of its estimate. Increments are composed
// one by one, since only so poses that share them stay rigid.
void IncrementalSolver::fold(std::uint32_t variable) {
  if (variables_[variable].is_block) {
    blocks_[variables_[variable].index].fold(tree_.delta_of(variable));
    return;
  }
  Pose& pose = pose_with(variable);
  pose.folded = pose_at(variable);
  pose.folded_delta = tree_.delta(variable);
}

// Measures anew how far these terms and those of these poses are from their linearisation.
void IncrementalSolver::check(const std::vector<std::uint32_t>& linearized,
                              const std::vector<std::uint32_t>& moved) {
  ++stamp_;
  std::vector<std::uint32_t> due;
  std::vector<std::uint32_t> other;
  const auto add = [&](const std::vector<std::uint32_t>& terms, std::vector<std::uint32_t>& to) {
    for (const std::uint32_t id : terms) {
      if (std::exchange(terms_[id].checked, stamp_) != stamp_) to.push_back(id);
    }
  };
  add(linearized, due);
  for (const std::uint32_t variable : moved) {
    add(variables_[variable].terms, other);
    add(variables_[variable].mixed, other);
  }
  for (std::size_t i = 0; i < other.size(); ++i) {
    fetch_change(other, i);
    if (has_changed(terms_[other[i]])) due.push_back(other[i]);
  }
  for (std::size_t i = 0; i < due.size(); ++i) {
    fetch(due, i);
    fetch_measurements(due, i);
    evaluate(due[i]);
    Term& term = terms_[due[i]];
    if (!term.pending && term.mismatch > 0) {
      term.pending = true;
      pending_.push_back(due[i]);
    }
  }
  const double negligible = kNegligible * options_.relinearization * typical();
  std::erase_if(pending_, [&](std::uint32_t id) {
    Term& term = terms_[id];
    term.pending = !term.dirty && term.mismatch > negligible * term.rows;
    return !term.pending;
  });
}

// Mean squared residual of a row.
double IncrementalSolver::typical() const {
  return std::max(squared_norm_ / std::max(rows_, 1.0), kLeastTypical);
}

// Of the pending terms, worst first, those near the root of the tree until little is left: what
// came in last is what is farthest off, and cheap. False if more would be left.
bool IncrementalSolver::choose_near(double limit, std::vector<std::uint32_t>& chosen) {
  const double worst = options_.worst_mismatch * options_.worst_mismatch * typical();
  const double most = std::min(kCheap * options_.budget, credit_);
  double rest = most;
  double left = mismatch_;
  std::vector<char> marked;
  for (const std::uint32_t id : pending_) {
    const Term& term = terms_[id];
    if (left <= kLeave * limit && !(term.mismatch > worst * term.rows)) break;
    if (!tree_.mark_up_to(rest, poses_of(id), marked)) continue;
    chosen.push_back(id);
    left -= term.mismatch;
  }
  if (left > kLeave * limit) return false;
  credit_ -= most - rest;
  return true;
}

void IncrementalSolver::take_pending(std::uint32_t id) {
  Term& term = terms_[id];
  term.pending = false;
  mismatch_ -= term.mismatch;
  term.mismatch = 0;
  mark_dirty(id);
}

// Marks pending terms as dirty, if together they or one of them are too far off. All of them, as
// soon as that can be paid: linearising a part anew shifts the weak modes of the graph, and so
// takes others off. If it never can be, the worst first. Until then, what is bad and cheap.
// A graph with blocks has modes so weak (a beacon's, seen from a straight line; a calibration's)
// that each step moves all of it, and so no step settles it. There what is near the root comes by
// itself after a step of this update (`again`) where that is enough. Returns how many.
std::size_t IncrementalSolver::choose(bool again) {
  const double worst = options_.worst_mismatch * options_.worst_mismatch * typical();
  const auto is_bad = [&](const Term& term) { return term.mismatch > worst * term.rows; };
  const double limit = options_.relinearization * std::max(squared_norm_, kLeastTypical);
  if (mismatch_ <= limit && std::none_of(pending_.begin(), pending_.end(),
                                         [&](std::uint32_t id) { return is_bad(terms_[id]); })) {
    return 0;
  }
  std::sort(pending_.begin(), pending_.end(), [this](std::uint32_t a, std::uint32_t b) {
    return std::pair(-terms_[a].mismatch, a) < std::pair(-terms_[b].mismatch, b);
  });
  std::vector<std::uint32_t> near;
  if (again && !blocks_.empty() && choose_near(limit, near)) {
    for (const std::uint32_t id : near) take_pending(id);
    std::erase_if(pending_, [this](std::uint32_t id) { return !terms_[id].pending; });
    return near.size();
  }
  double total = 0;
  std::vector<char> marked;
  for (const std::uint32_t id : pending_) total += tree_.cost_of(poses_of(id), marked);
  const double full = options_.burst * options_.budget;
  const bool all = total <= credit_;
  const double ceiling = all || total > full ? credit_ : kCheap * options_.budget;

  marked.clear();
  std::size_t chosen = 0;
  for (const std::uint32_t id : pending_) {
    const Term& term = terms_[id];
    bool accept = all || (chosen > 0 && tree_.is_marked(poses_of(id), marked));
    if (!accept && (is_bad(term) || total > full)) {
      std::vector<char> tried = marked;
      const double price = tree_.cost_of(poses_of(id), tried);
      accept = price <= std::min(ceiling, credit_);
      if (accept) {
        credit_ -= price;
        marked = std::move(tried);
      }
    }
    if (!accept) continue;
    take_pending(id);
    ++chosen;
  }
  if (all) credit_ -= total;
  std::erase_if(pending_, [this](std::uint32_t id) { return !terms_[id].pending; });
  return chosen;
}

UpdateSummary IncrementalSolver::update(const std::stop_token& stop) {
  UpdateSummary summary;
  evaluated_ = 0;
  credit_ = std::min(credit_ + options_.budget, options_.burst * options_.budget);
  bool to_solve = !jumped_.empty();
  if (to_solve) {
    summary.relinearized += settle_moves();
  } else if (!blocks_.empty() || (dirty_.empty() && touched_.empty())) {
    summary.relinearized += choose(false);
  }
  for (int i = 0; i < options_.max_steps; ++i) {
    if (dirty_.empty() && touched_.empty() && damped_.empty() && !to_solve) break;
    summary.stopped = i > 0 && stop.stop_requested();
    if (summary.stopped) break;
    to_solve = false;
    step(summary);
    if (i + 1 < options_.max_steps) summary.relinearized += choose(true);
  }
  for (std::vector<std::uint32_t>* moved : {&summary.moved, &summary.moved_blocks}) {
    std::sort(moved->begin(), moved->end());
    moved->erase(std::unique(moved->begin(), moved->end()), moved->end());
  }
  summary.evaluated = evaluated_;
  if (!summary.stopped) {
    newest_.clear();
    summary.marginalized = slide_window();
    condense_old();
  }
  summary.pending = pending_.size();
  return summary;
}

}  // namespace hybrid_slam
