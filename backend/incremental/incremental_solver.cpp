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

// Mean squared residual below which measurements count as perfect.
constexpr double kLeastTypical = 1e-12;

}  // namespace

std::string IncrementalOptions::validate() const {
  if (!(relinearization > 0)) return "relinearization must be positive";
  if (!(worst_mismatch > 0)) return "worst_mismatch must be positive";
  if (window < 0) return "window must not be negative";
  if (!(burst >= 1)) return "burst must be at least 1";
  if (!(wildfire >= 0)) return "wildfire must not be negative";
  if (max_steps < 1) return "max_steps must be positive";
  if (!(budget >= 0)) return "budget must not be negative";
  if (!(chi2_mono > 0) || !(chi2_stereo > 0) || !(chi2_loop > 0))
    return "chi2 thresholds must be positive";
  return {};
}

IncrementalSolver::IncrementalSolver(const IncrementalOptions& options)
    : options_(options), tree_(PoseTree::Options{}) {
  if (const std::string wrong = options.validate(); !wrong.empty()) {
    throw std::invalid_argument("IncrementalOptions: " + wrong);
  }
}

IncrementalSolver::~IncrementalSolver() = default;

std::span<const std::uint32_t> IncrementalSolver::terms_of(std::uint32_t pose) const {
  return poses_[pose].terms;
}

std::span<const std::uint32_t> IncrementalSolver::poses_of(std::uint32_t term) const {
  const Term& t = terms_[term];
  if (t.kind == TermKind::kEdge) {
    const EdgeTerm& edge = edge_terms_[t.index];
    return {edge.poses, edge.variable};
  }
  if (t.kind == TermKind::kPrior) return priors_[t.index].poses;
  return landmarks_[t.index].poses;
}

void IncrementalSolver::assemble(std::uint32_t term, Front& front) const {
  const Term& t = terms_[term];
  if (t.kind == TermKind::kEdge) {
    edge_terms_[t.index].assemble(front);
  } else if (t.kind == TermKind::kPrior) {
    priors_[t.index].assemble(front);
  } else {
    landmarks_[t.index].assemble(front);
  }
}

void IncrementalSolver::mark_dirty(std::uint32_t term) {
  if (terms_[term].dirty) return;
  terms_[term].dirty = true;
  dirty_.push_back(term);
}

Vector6d IncrementalSolver::delta(std::uint32_t pose) const {
  return poses_[pose].fixed ? Vector6d::Zero() : tree_.delta(pose);
}

Matrix6d IncrementalSolver::covariance(std::uint32_t pose) const {
  if (poses_.at(pose).fixed) return Matrix6d::Zero();
  // The left perturbation that an increment is.
  const Matrix6d left = poses_[pose].tangent.from_left(Matrix6d::Identity(), this->pose(pose));
  return left * tree_.covariance(pose) * left.transpose();
}

Rigid3d IncrementalSolver::pose(std::uint32_t index) const {
  const Pose& pose = poses_.at(index);
  if (pose.fixed || tree_.delta(index) == pose.folded_delta) return pose.folded;
  return pose.tangent.moved(pose.folded, tree_.delta(index) - pose.folded_delta);
}

Eigen::Vector3d IncrementalSolver::point(std::uint32_t index) const {
  const LandmarkTerm& landmark = landmarks_.at(index);
  Eigen::Vector3d at = carried_base(landmark);
  if (!landmark.solvable) return at;
  at += displacement(landmark);
  if (landmark.anchor != LandmarkTerm::kNoAnchor) {
    at -= poses_[landmark.anchor].tangent.carried(
        landmark.base, tree_.delta(landmark.anchor) - landmark.anchor_delta);
  }
  return at;
}

Eigen::Vector3d IncrementalSolver::displacement(const LandmarkTerm& landmark) const {
  return landmark.displacement([this](std::uint32_t pose) { return tree_.delta(pose); });
}

// Where its anchor's motion, in full, took the point since it was linearised.
Eigen::Vector3d IncrementalSolver::carried_base(const LandmarkTerm& landmark) const {
  if (landmark.anchor == LandmarkTerm::kNoAnchor) return landmark.base;
  return inverse(pose(landmark.anchor)) * landmark.in_anchor;
}

// Makes the pose's increments since the last time part of its estimate. Increments are composed one
// by one, since only so poses that share them stay rigid.
void IncrementalSolver::fold(std::uint32_t index) {
  poses_[index].folded = pose(index);
  poses_[index].folded_delta = tree_.delta(index);
}

// Measures anew how far these terms and those of these poses are from their linearisation.
void IncrementalSolver::check(const std::vector<std::uint32_t>& linearized,
                              const std::vector<std::uint32_t>& moved) {
  ++stamp_;
  const auto check_term = [this](std::uint32_t id) {
    Term& term = terms_[id];
    if (term.checked == stamp_) return;
    term.checked = stamp_;
    evaluate(id);
    if (!term.pending && term.mismatch > 0) {
      term.pending = true;
      pending_.push_back(id);
    }
  };
  for (const std::uint32_t id : linearized) check_term(id);
  for (const std::uint32_t pose : moved) {
    for (const std::uint32_t id : poses_[pose].terms) check_term(id);
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

// Marks pending terms as dirty, if together they or one of them are too far off. All of them, as
// soon as that can be paid: linearising a part anew shifts the weak modes of the graph, and so
// takes others off. If it never can be, the worst first. Until then, what is bad and cheap. Returns
// how many.
std::size_t IncrementalSolver::choose() {
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
  double total = 0;
  std::vector<char> marked;
  for (const std::uint32_t id : pending_) total += tree_.cost_of(poses_of(id), marked);
  const double full = options_.burst * options_.budget;
  const bool all = total <= credit_;
  const double ceiling = all || total > full ? credit_ : kCheap * options_.budget;

  marked.clear();
  std::size_t chosen = 0;
  for (const std::uint32_t id : pending_) {
    Term& term = terms_[id];
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
    term.pending = false;
    mismatch_ -= term.mismatch;
    term.mismatch = 0;
    mark_dirty(id);
    ++chosen;
  }
  if (all) credit_ -= total;
  std::erase_if(pending_, [this](std::uint32_t id) { return !terms_[id].pending; });
  return chosen;
}

UpdateSummary IncrementalSolver::update() {
  UpdateSummary summary;
  credit_ = std::min(credit_ + options_.budget, options_.burst * options_.budget);
  std::vector<std::uint32_t> linearized;
  std::vector<std::uint32_t> moved;
  bool to_solve = !jumped_.empty();
  if (to_solve) {
    summary.relinearized += settle_moves();
  } else if (dirty_.empty() && touched_.empty()) {
    summary.relinearized += choose();
  }
  for (int step = 0; step < options_.max_steps; ++step) {
    if (dirty_.empty() && touched_.empty() && !to_solve) break;
    to_solve = false;
    linearized = std::exchange(dirty_, {});
    for (const std::uint32_t term : linearized) {
      linearize(term);
      terms_[term].dirty = false;
      const auto poses = poses_of(term);
      touched_.insert(touched_.end(), poses.begin(), poses.end());
    }
    if (!touched_.empty()) {
      tree_.refactor(touched_, newest_, *this);
      touched_.clear();
      summary.poses += tree_.last_poses();
      summary.multiplications += tree_.last_cost();
    }
    ++summary.steps;
    moved.clear();
    tree_.solve(options_.wildfire, moved);
    for (const std::uint32_t pose : moved) fold(pose);
    summary.moved.insert(summary.moved.end(), moved.begin(), moved.end());
    check(linearized, moved);
    if (step + 1 < options_.max_steps) summary.relinearized += choose();
  }
  newest_.clear();
  std::sort(summary.moved.begin(), summary.moved.end());
  summary.moved.erase(std::unique(summary.moved.begin(), summary.moved.end()), summary.moved.end());
  summary.marginalized = slide_window();
  summary.pending = pending_.size();
  return summary;
}

FactorGraph IncrementalSolver::graph() const {
  FactorGraph graph;
  for (const Camera& camera : cameras_) graph.cameras.push_back({camera, 0});
  for (std::uint32_t i = 0; i < poses_.size(); ++i) {
    graph.frames.push_back({pose(i), poses_[i].camera, poses_[i].fixed});
  }
  for (std::uint32_t i = 0; i < landmarks_.size(); ++i) graph.points.push_back({point(i), false});
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    if (observation_there_[i] != 0) graph.observations.push_back(observations_[i]);
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    if (edge_there_[i] != 0) graph.edges.push_back(edges_[i]);
  }
  for (const PriorTerm& prior : priors_) {
    if (prior.poses.empty()) continue;
    GraphPrior made{prior.poses, {}, prior.rows.jacobian, prior.rows.residual};
    for (std::size_t k = 0; k < prior.poses.size(); ++k) {
      const std::uint32_t i = prior.poses[k];
      auto by_pose = made.jacobian.middleCols<6>(static_cast<Eigen::Index>(6 * k));
      made.bases.push_back(pose(i));
      made.residual += by_pose * delta(i);
      by_pose = poses_[i].tangent.to_origin(by_pose);
    }
    graph.priors.push_back(std::move(made));
  }
  return graph;
}

}  // namespace hybrid_slam
