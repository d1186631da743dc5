#include <algorithm>
#include <set>
#include <utility>

#include "backend/incremental/condensation_groups.h"
#include "backend/incremental/incremental_solver.h"

// How an IncrementalSolver condenses what it has not seen for a while.

namespace hybrid_slam {

// Whether a landmark may be condensed: no recent pose sees it, and it is linearised where it is.
// One that waits for that has waited long enough.
bool IncrementalSolver::is_old(std::uint32_t point, std::uint32_t recent) {
  const LandmarkTerm& landmark = *landmarks_[point];
  Term& term = terms_[landmark_terms_[point]];
  if (term.dirty || !landmark.solvable || !landmark.factors.empty() || landmark.poses.empty() ||
      !landmark.held_back.isZero(0)) {
    return false;
  }
  for (const LandmarkView& view : landmark.views) {
    if (!view.usable || variables_[view.pose].index >= recent) return false;
  }
  if (term.pending) mark_dirty(landmark_terms_[point]);
  return !term.pending;
}

// Condenses landmarks that one clique of the tree holds: so what is factored stays as it is.
void IncrementalSolver::condense_old() {
  const auto keep = static_cast<std::size_t>(options_.condense_after);
  if (keep == 0 || poses_.size() < next_condensation_ || !touched_.empty()) return;
  next_condensation_ = poses_.size() + std::max<std::size_t>(1, keep / 4);
  if (poses_.size() <= keep) return;
  const auto recent = static_cast<std::uint32_t>(poses_.size() - keep);
  const std::vector<std::int32_t> depths = tree_.depths();
  std::vector<CondensableLandmark> candidates;
  std::erase_if(live_points_, [&](std::uint32_t point) {
    return point_there_[point] == 0 || condensed_in_[point] != kNone;
  });
  std::sort(live_points_.begin(), live_points_.end());
  live_points_.erase(std::unique(live_points_.begin(), live_points_.end()), live_points_.end());
  for (const std::uint32_t point : live_points_) {
    if (!is_old(point, recent)) continue;
    std::vector<std::uint32_t> poses = landmarks_[point]->poses;
    std::sort(poses.begin(), poses.end());
    const std::int32_t clique = tree_.clique_of(poses, depths);
    if (clique >= 0) candidates.push_back({clique, std::move(poses), point});
  }
  // To be taken apart in what an update may spend on old terms.
  const double most_work = options_.burst * options_.budget;
  const std::vector<KnownGroup> known = known_groups(candidates, depths);
  for (const CondensedGroup& group : condensed_groups(std::move(candidates), known, most_work)) {
    condense(group);
  }
}

// The condensed terms that these landmarks may join: of the same cliques, and linearised well where
// they were. What joins one is linear about where that was made, and wherever it was.
std::vector<KnownGroup> IncrementalSolver::known_groups(
    const std::vector<CondensableLandmark>& landmarks,
    const std::vector<std::int32_t>& depths) const {
  std::set<std::int32_t> cliques;
  std::set<std::uint32_t> poses;
  std::set<std::uint32_t> terms;
  for (const CondensableLandmark& landmark : landmarks) {
    cliques.insert(landmark.clique);
    poses.insert(landmark.poses.begin(), landmark.poses.end());
  }
  for (const std::uint32_t pose : poses) {
    for (const std::uint32_t id : variables_[pose].terms) {
      const Term& term = terms_[id];
      if (term.kind == TermKind::kCondensed && !term.dirty && !term.pending) terms.insert(id);
    }
  }
  std::vector<KnownGroup> known;
  for (const std::uint32_t id : terms) {
    const CondensedTerm& term = condensed_[terms_[id].index];
    const std::int32_t clique = tree_.clique_of(term.poses, depths);
    if (!cliques.contains(clique)) continue;
    KnownGroup group{clique, terms_[id].index, term.poses, {}};
    for (std::size_t i = 0; i < term.members.size(); ++i) {
      group.views.push_back(term.observations_of(i).size());
    }
    known.push_back(std::move(group));
  }
  return known;
}

void IncrementalSolver::condense(const CondensedGroup& group) {
  std::vector<std::uint32_t> points = group.points;
  std::sort(points.begin(), points.end());
  const std::uint32_t index = group.term == CondensedGroup::kNew ? free_condensed() : group.term;
  CondensedTerm& term = condensed_[index];
  const Eigen::VectorXd now = deltas_of(group.poses);
  std::vector<std::uint32_t> linked;
  if (group.term == CondensedGroup::kNew) {
    term = {};
    term.begin(group.poses, now);
    condensed_ids_[index] = add_term(TermKind::kCondensed, index);
  } else {
    linked = all_variables_of_term(condensed_ids_[index]);
    if (term.poses != group.poses) {
      // A motion of all of them since the term was made is no change of their shape.
      term.widen(group.poses, deltas_before(group.poses, term, term.at),
                 deltas_before(group.poses, term, term.placed));
    }
  }
  std::vector<const LandmarkTerm*> landmarks;
  std::vector<double> costs;
  for (const std::uint32_t point : points) {
    landmarks.push_back(landmarks_[point].get());
    costs.push_back(terms_[landmark_terms_[point]].cost);
  }
  term.add(landmarks, costs, places_of(group.poses), now);
  for (const std::uint32_t point : points) move_into(term, point);
  term.order_members();
  for (const std::uint32_t point : points) condensed_in_[point] = index;
  condensed_count_ += points.size();
  const std::uint32_t id = condensed_ids_[index];
  for (const std::uint32_t v : all_variables_of_term(id)) {
    if (std::find(linked.begin(), linked.end(), v) == linked.end()) link(v, id);
    variables_[v].terms.shrink_to_fit();
  }
  evaluate(id);
}

std::uint32_t IncrementalSolver::free_condensed() {
  if (free_condensed_.empty()) {
    condensed_.emplace_back();
    condensed_ids_.push_back(kNone);
    return static_cast<std::uint32_t>(condensed_.size()) - 1;
  }
  const std::uint32_t index = free_condensed_.back();
  free_condensed_.pop_back();
  return index;
}

// A landmark of which the term has the sums becomes a member of it, and no term of its own any
// more.
void IncrementalSolver::move_into(CondensedTerm& term, std::uint32_t point) {
  const std::uint32_t id = landmark_terms_[point];
  const LandmarkTerm& landmark = *landmarks_[point];
  CondensedTerm::Member member;
  member.landmark = point;
  member.first = static_cast<std::uint32_t>(term.observations.size());
  member.anchor = landmark.poses.front();
  member.in_anchor = (pose_at(member.anchor) * this->point(point)).cast<float>();
  term.members.push_back(member);
  for (const LandmarkView& view : landmark.views) term.observations.push_back(view.observation);
  for (const std::uint32_t v : all_variables(landmark)) unlink(v, id);
  forget_sums(id);
  landmarks_[point].reset();
  landmark_terms_[point] = kNone;
  free_terms_.push_back(id);
}

}  // namespace hybrid_slam
