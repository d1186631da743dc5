#include "backend/incremental/incremental_solver.h"

#include <ceres/cost_function.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "backend/problem/measurement_fault.h"
#include "factors/make_reprojection_factor.h"
#include "factors/relative_pose_factor.h"

namespace hybrid_slam {

namespace {

// A term's squared mismatch per row that is not worth a thought, as a fraction of the typical
// squared residual times what relinearization allows.
constexpr double kNegligible = 1e-2;

// What may be linearised anew at once while credit is saved for all, in parts of the budget.
constexpr double kCheap = 0.1;

// Mean squared residual below which measurements count as perfect.
constexpr double kLeastTypical = 1e-12;

template <typename T>
T& item(std::vector<T>& items, std::uint32_t index, const char* what) {
  if (index >= items.size())
    throw std::logic_error(std::string("IncrementalSolver: no such ") + what);
  return items[index];
}

// Throws if there is a fault.
void refuse(const char* fault, const char* what) {
  if (fault == nullptr) return;
  throw std::logic_error("IncrementalSolver: " + std::string(what) + ": " + fault);
}

bool sees(const LandmarkTerm& landmark, std::uint32_t pose) {
  return std::any_of(landmark.views.begin(), landmark.views.end(),
                     [&](const LandmarkView& view) { return view.pose == pose; });
}

void erase_value(std::vector<std::uint32_t>& values, std::uint32_t value) {
  values.erase(std::remove(values.begin(), values.end(), value), values.end());
}

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

std::uint32_t IncrementalSolver::add_camera(const Camera& camera) {
  cameras_.push_back(camera);
  return static_cast<std::uint32_t>(cameras_.size()) - 1;
}

std::uint32_t IncrementalSolver::add_pose(const GraphFrame& frame) {
  refuse(frame.cam_from_world.params.allFinite() ? nullptr : "not finite", "pose");
  const auto index = static_cast<std::uint32_t>(poses_.size());
  Pose pose;
  pose.tangent.place = inverse(frame.cam_from_world).translation();
  pose.folded = frame.cam_from_world;
  pose.camera = frame.camera;
  pose.fixed = frame.fixed;
  poses_.push_back(std::move(pose));
  tree_.resize(poses_.size());
  if (!frame.fixed) newest_.push_back(index);
  return index;
}

std::uint32_t IncrementalSolver::add_point(const Eigen::Vector3d& in_world) {
  refuse(in_world.allFinite() ? nullptr : "not finite", "point");
  LandmarkTerm landmark;
  landmark.base = in_world;
  if (!free_points_.empty()) {
    const std::uint32_t index = free_points_.back();
    free_points_.pop_back();
    landmarks_[index] = std::move(landmark);
    point_there_[index] = 1;
    return index;
  }
  landmarks_.push_back(std::move(landmark));
  point_there_.push_back(1);
  landmark_terms_.push_back(
      add_term(TermKind::kLandmark, static_cast<std::uint32_t>(landmarks_.size()) - 1));
  return static_cast<std::uint32_t>(landmarks_.size()) - 1;
}

std::uint32_t IncrementalSolver::add_term(TermKind kind, std::uint32_t index) {
  Term term;
  term.kind = kind;
  term.index = index;
  terms_.push_back(term);
  return static_cast<std::uint32_t>(terms_.size()) - 1;
}

std::uint32_t IncrementalSolver::add_observation(const GraphObservation& observation) {
  Pose& pose = item(poses_, observation.frame, "pose");
  LandmarkTerm& landmark = item(landmarks_, observation.point, "point");
  refuse(point_there_[observation.point] != 0 ? nullptr : "was removed", "point");
  const Camera& camera = item(cameras_, pose.camera, "camera");
  refuse(measurement_fault(observation, camera), "observation");
  const std::uint32_t index = free_observation();
  observations_[index] = observation;
  observation_there_[index] = 1;
  observation_factors_[index] =
      make_reprojection_factor(camera, observation.measurement, observation.sigma);
  LandmarkView view;
  view.observation = index;
  view.pose = observation.frame;
  view.fixed = pose.fixed;
  const bool is_first = !sees(landmark, observation.frame);
  landmark.views.push_back(view);
  if (!pose.fixed && is_first) {
    landmark.poses.push_back(observation.frame);
    pose.terms.push_back(landmark_terms_[observation.point]);
  }
  mark_dirty(landmark_terms_[observation.point]);
  return index;
}

std::uint32_t IncrementalSolver::free_observation() {
  if (!free_observations_.empty()) {
    const std::uint32_t index = free_observations_.back();
    free_observations_.pop_back();
    return index;
  }
  observations_.emplace_back();
  observation_there_.push_back(0);
  observation_factors_.emplace_back();
  return static_cast<std::uint32_t>(observations_.size()) - 1;
}

std::uint32_t IncrementalSolver::add_edge(const GraphEdge& edge) {
  item(poses_, edge.a, "pose");
  item(poses_, edge.b, "pose");
  refuse(measurement_fault(edge), "edge");
  const auto index = static_cast<std::uint32_t>(edges_.size());
  edges_.push_back(edge);
  edge_there_.push_back(1);
  edge_factors_.push_back(std::make_unique<RelativePoseFactor>(edge.a_from_b, edge.information));
  EdgeTerm term;
  for (const std::uint32_t pose : {edge.a, edge.b}) {
    if (!poses_[pose].fixed) term.poses[term.variable++] = pose;
  }
  edge_terms_.push_back(term);
  const std::uint32_t id = add_term(TermKind::kEdge, index);
  edge_ids_.push_back(id);
  for (const std::uint32_t pose : poses_of(id)) poses_[pose].terms.push_back(id);
  mark_dirty(id);
  return index;
}

void IncrementalSolver::remove_observation(std::uint32_t observation) {
  if (item(observation_there_, observation, "observation") == 0) return;
  observation_there_[observation] = 0;
  const GraphObservation& removed = observations_[observation];
  LandmarkTerm& landmark = landmarks_[removed.point];
  const std::uint32_t term = landmark_terms_[removed.point];
  mark_dirty(term);  // before: its former poses are touched too
  observation_factors_[observation].reset();
  free_observations_.push_back(observation);
  std::erase_if(landmark.views,
                [&](const LandmarkView& view) { return view.observation == observation; });
  if (!poses_[removed.frame].fixed && !sees(landmark, removed.frame)) {
    touched_.push_back(removed.frame);
    erase_value(landmark.poses, removed.frame);
    erase_value(poses_[removed.frame].terms, term);
  }
}

void IncrementalSolver::remove_point(std::uint32_t point) {
  const LandmarkTerm& landmark = item(landmarks_, point, "point");
  if (point_there_[point] == 0) return;
  point_there_[point] = 0;
  while (!landmark.views.empty()) remove_observation(landmark.views.back().observation);
  free_points_.push_back(point);
}

void IncrementalSolver::remove_edge(std::uint32_t edge) {
  if (item(edge_there_, edge, "edge") == 0) return;
  edge_there_[edge] = 0;
  mark_dirty(edge_ids_[edge]);
  for (std::size_t i = 0; i < edge_terms_[edge].variable; ++i) {
    const std::uint32_t pose = edge_terms_[edge].poses[i];
    touched_.push_back(pose);
    erase_value(poses_[pose].terms, edge_ids_[edge]);
  }
  edge_terms_[edge].variable = 0;
}

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
  if (dirty_.empty() && touched_.empty()) summary.relinearized += choose();
  for (int step = 0; step < options_.max_steps; ++step) {
    if (dirty_.empty() && touched_.empty()) break;
    linearized = std::exchange(dirty_, {});
    for (const std::uint32_t term : linearized) {
      linearize(term);
      terms_[term].dirty = false;
      const auto poses = poses_of(term);
      touched_.insert(touched_.end(), poses.begin(), poses.end());
    }
    tree_.refactor(touched_, newest_, *this);
    touched_.clear();
    ++summary.steps;
    summary.poses += tree_.last_poses();
    summary.multiplications += tree_.last_cost();
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
