#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "backend/incremental/incremental_solver.h"
#include "backend/map/prefetch.h"

// The condensed landmarks of an IncrementalSolver: evaluated, made anew, and taken apart again.

namespace hybrid_slam {

namespace {

// Condensed landmarks keep their place before their anchor, and are not evaluated, while the poses
// that see them have not moved against one another by more than this, in standard deviations of an
// observation.
constexpr double kStill = 0.05;

}  // namespace

// The deltas of a condensed term's poses now.
Eigen::VectorXd IncrementalSolver::deltas_of(const std::vector<std::uint32_t>& poses) const {
  Eigen::VectorXd deltas(static_cast<Eigen::Index>(6 * poses.size()));
  Eigen::Index row = 0;
  for (const std::uint32_t pose : poses) {
    deltas.segment<6>(row) = tree_.delta(pose);
    row += 6;
  }
  return deltas;
}

std::vector<Eigen::Vector3d> IncrementalSolver::places_of(
    const std::vector<std::uint32_t>& poses) const {
  std::vector<Eigen::Vector3d> places;
  for (const std::uint32_t pose : poses) places.push_back(pose_with(pose).tangent.place);
  return places;
}

// What a term's poses moved together since they had these deltas, as its first pose did.
Vector6d IncrementalSolver::common_motion(const CondensedTerm& term,
                                          const Eigen::VectorXd& since) const {
  if (term.is_held) return Vector6d::Zero();
  const std::uint32_t first = term.poses.front();
  return pose_with(first).tangent.at_origin(tree_.delta(first) - since.head<6>());
}

// The deltas that poses would have if they had not moved along with a term's since then.
Eigen::VectorXd IncrementalSolver::deltas_before(const std::vector<std::uint32_t>& poses,
                                                 const CondensedTerm& term,
                                                 const Eigen::VectorXd& since) const {
  const Vector6d common = common_motion(term, since);
  Eigen::VectorXd deltas = deltas_of(poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    deltas.segment<6>(static_cast<Eigen::Index>(6 * i)) -=
        pose_with(poses[i]).tangent.increment(common);
  }
  return deltas;
}

// How far a view of each pose is, in standard deviations of an observation, from what it would be
// if the poses had moved together since they had these deltas. A turn by t moves what is seen by
// |derivative| t, and by a part t of that in second order; a way counts by the turn that it looks
// like.
std::vector<double> IncrementalSolver::shape_change(const CondensedTerm& term,
                                                    const Eigen::VectorXd& since) const {
  std::vector<double> change;
  const Vector6d common = common_motion(term, since);
  for (std::size_t i = 0; i < term.poses.size(); ++i) {
    const WorldTangent& tangent = pose_with(term.poses[i]).tangent;
    const Vector6d moved =
        tree_.delta(term.poses[i]) - since.segment<6>(static_cast<Eigen::Index>(6 * i));
    const Vector6d xi = tangent.at_origin(moved);
    const Vector6d own = tangent.increment(xi - common);
    const CondensedTerm::Reach& reach = term.reach[i];
    const double views = std::max(reach.views, 1);
    change.push_back(own.tail<3>().norm() * std::sqrt(reach.by_turn / views) +
                     own.head<3>().norm() * std::sqrt(reach.by_way / views));
  }
  return change;
}

bool IncrementalSolver::is_still(const CondensedTerm& term, const Eigen::VectorXd& since) const {
  const std::vector<double> change = shape_change(term, since);
  return std::all_of(change.begin(), change.end(),
                     [](double by_view) { return by_view <= kStill; });
}

// Whether there is anything to evaluate. Far terms move along with all else at each update.
bool IncrementalSolver::has_changed(const CondensedTerm& term) const {
  return !is_still(term, term.evaluated_at.cast<double>()) ||
         (!term.is_stale && !is_still(term, term.placed));
}

IncrementalSolver::Evaluation IncrementalSolver::evaluate_condensed(std::uint32_t index) {
  CondensedTerm& term = condensed_[index];
  Evaluation result;
  if (term.members.empty()) return result;
  const Eigen::VectorXd deltas = deltas_of(term.poses);
  term.evaluated_at = deltas.cast<float>();
  result.squared_norm = std::max(term.squared_norm_at(deltas), 0.0);
  result.cost = std::max(result.squared_norm + term.loss_excess, 0.0);
  result.rows = term.rows;
  term.is_stale = term.is_stale || !is_still(term, term.placed);
  const std::vector<double> change = shape_change(term, term.at);
  for (std::size_t i = 0; i < change.size(); ++i) {
    const CondensedTerm::Reach& reach = term.reach[i];
    if (reach.by_turn > 0) {
      result.squared_mismatch += std::pow(change[i], 4) * reach.views * reach.views / reach.by_turn;
    }
  }
  return result;
}

// Where a member's point lies with its anchor where it is.
Eigen::Vector3d IncrementalSolver::kept_place(const CondensedTerm::Member& member) const {
  return inverse(pose_at(member.anchor)) * member.in_anchor.cast<double>();
}

// Where it fits its observations best with all poses where they are, to second order from where it
// is kept; nothing if they do not determine it.
std::optional<Eigen::Vector3d> IncrementalSolver::best_place(const CondensedTerm& term,
                                                             std::size_t member) const {
  const Eigen::Vector3d start = kept_place(term.members[member]);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  const auto observations = term.observations_of(member);
  for (const std::uint32_t observation : observations) prefetch(&observations_[observation]);
  for (const std::uint32_t observation : observations) {
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_point;
    by_point.row(2).setZero();
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    if (!reproject(observation, pose(observations_[observation].frame), start, residual.data(),
                   nullptr, by_point.data())) {
      continue;
    }
    const double root = view_loss(observation).root_weight(residual.squaredNorm());
    information.noalias() += root * root * by_point.transpose() * by_point;
    gradient.noalias() += root * root * by_point.transpose() * residual;
  }
  Eigen::Matrix3d factor;
  if (!factor_point(information, factor)) return std::nullopt;
  factor.triangularView<Eigen::Lower>().solveInPlace(gradient);
  factor.transpose().triangularView<Eigen::Upper>().solveInPlace(gradient);
  return start - gradient;
}

// A member as a term of its own, not linearised.
LandmarkTerm IncrementalSolver::taken_out(const CondensedTerm& term, std::size_t member) const {
  const CondensedTerm::Member& of = term.members[member];
  LandmarkTerm landmark;
  landmark.base = kept_place(of);
  const auto observations = term.observations_of(member);
  landmark.views.reserve(observations.size());
  for (const std::uint32_t observation : observations) {
    LandmarkView& view = landmark.views.emplace_back();
    view.observation = observation;
    view.pose = poses_[observations_[view.observation].frame].variable;
    view.fixed = variables_[view.pose].fixed;
    if (!view.fixed && std::find(landmark.poses.begin(), landmark.poses.end(), view.pose) ==
                           landmark.poses.end()) {
      landmark.poses.push_back(view.pose);
    }
  }
  return landmark;
}

std::size_t IncrementalSolver::member_of(std::uint32_t point) const {
  const std::vector<CondensedTerm::Member>& members = condensed_[condensed_in_[point]].members;
  return static_cast<std::size_t>(
      std::lower_bound(members.begin(), members.end(), point,
                       [](const CondensedTerm::Member& of, std::uint32_t wanted) {
                         return of.landmark < wanted;
                       }) -
      members.begin());
}

// A landmark by itself, linearised at the present estimate, wherever it is kept.
LandmarkTerm IncrementalSolver::linearized_landmark(std::uint32_t point) const {
  LandmarkTerm landmark = taken_out(condensed_[condensed_in_[point]], member_of(point));
  linearize(landmark, landmark.base);
  return landmark;
}

Eigen::Vector3d IncrementalSolver::condensed_point(std::uint32_t point) const {
  const CondensedTerm& term = condensed_[condensed_in_[point]];
  const std::size_t member = member_of(point);
  const Eigen::Vector3d kept = kept_place(term.members[member]);
  return term.is_stale ? best_place(term, member).value_or(kept) : kept;
}

// The points of its term are minimised over their observations, with the poses where they are.
void IncrementalSolver::place(std::uint32_t point) {
  if (condensed_in_.at(point) == kNone) return;
  CondensedTerm& term = condensed_[condensed_in_[point]];
  if (!term.is_stale) return;
  for (std::size_t i = 0; i < term.members.size(); ++i) {
    const auto best = best_place(term, i);
    CondensedTerm::Member& of = term.members[i];
    if (best) of.in_anchor = (pose_at(of.anchor) * *best).cast<float>();
  }
  term.placed = deltas_of(term.poses);
  term.is_stale = false;
}

std::vector<Eigen::Vector3d> IncrementalSolver::place(std::span<const std::uint32_t> points) {
  std::vector<Eigen::Vector3d> estimates;
  estimates.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i + 2 * kPrefetchAhead < points.size()) {
      prefetch(landmarks_[points[i + 2 * kPrefetchAhead]].get());
    }
    if (i + kPrefetchAhead < points.size()) {
      const LandmarkTerm* const next = landmarks_[points[i + kPrefetchAhead]].get();
      if (next != nullptr) prefetch_all(next->views);
    }
    place(points[i]);
    estimates.push_back(point(points[i]));
  }
  return estimates;
}

// Makes a condensed term anew from its observations.
double IncrementalSolver::linearize_condensed(std::uint32_t index) {
  CondensedTerm& term = condensed_[index];
  const std::vector<std::uint32_t> poses = term.poses;
  std::vector<LandmarkTerm> landmarks;
  std::vector<double> costs;
  for (std::size_t i = 0; i < term.members.size(); ++i) {
    landmarks.push_back(taken_out(term, i));
    LandmarkTerm& landmark = landmarks.back();
    costs.push_back(linearize(landmark, best_place(term, i).value_or(landmark.base)));
  }
  std::vector<const LandmarkTerm*> members;
  for (const LandmarkTerm& landmark : landmarks) members.push_back(&landmark);
  term.begin(poses, deltas_of(poses));
  term.add(members, costs, places_of(poses), term.at);
  double cost = 0;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    cost += costs[i];
    CondensedTerm::Member& of = term.members[i];
    of.in_anchor = (pose_at(of.anchor) * landmarks[i].base).cast<float>();
  }
  return cost;
}

// Its landmarks become terms of their own.
void IncrementalSolver::take_apart(std::uint32_t index) {
  const std::uint32_t id = condensed_ids_[index];
  std::vector<LandmarkTerm> landmarks;
  for (std::size_t i = 0; i < condensed_[index].members.size(); ++i) {
    landmarks.push_back(taken_out(condensed_[index], i));
  }
  const CondensedTerm term = condensed_[index];
  drop_term(id);
  condensed_count_ -= landmarks.size();
  if (terms_[id].pending) std::erase(pending_, id);
  if (terms_[id].dirty) std::erase(dirty_, id);
  free_terms_.push_back(id);
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const std::uint32_t point = term.members[i].landmark;
    condensed_in_[point] = kNone;
    landmarks_[point] = std::make_unique<LandmarkTerm>(std::move(landmarks[i]));
    landmark_terms_[point] = add_term(TermKind::kLandmark, point);
    for (const std::uint32_t v : all_variables(*landmarks_[point])) link(v, landmark_terms_[point]);
    mark_dirty(landmark_terms_[point]);
    live_points_.push_back(point);
  }
}

// Those of these terms that are condensed.
void IncrementalSolver::take_apart(const std::vector<std::uint32_t>& terms) {
  for (const std::uint32_t id : std::vector<std::uint32_t>(terms)) {
    if (terms_[id].kind == TermKind::kCondensed) take_apart(terms_[id].index);
  }
}

// Takes apart what a landmark is condensed in, if it is.
LandmarkTerm& IncrementalSolver::live(std::uint32_t point) {
  if (condensed_in_[point] != kNone) take_apart(condensed_in_[point]);
  return *landmarks_[point];
}

}  // namespace hybrid_slam
