#include <chrono>
#include <utility>

#include "backend/backend.h"
#include "backend/map/components.h"
#include "backend/problem/loop_correction.h"

// How a Backend closes loops.

namespace hybrid_slam {

namespace {

// Loops over which an adjustment of everything that takes its time is carried.
constexpr std::size_t kMaxMoves = 16;

PoseConstraint constraint_of(const LoopMeasurement& loop) {
  PoseConstraint constraint;
  constraint.a = loop.keyframe;
  constraint.b = loop.match;
  constraint.a_from_b = loop.keyframe_from_match;
  constraint.loop = true;
  return constraint;
}

std::vector<PoseConstraint> constraints_of(const std::vector<LoopMeasurement>& loops) {
  std::vector<PoseConstraint> constraints;
  constraints.reserve(loops.size());
  for (const LoopMeasurement& loop : loops) constraints.push_back(constraint_of(loop));
  return constraints;
}

std::vector<LoopEnds> ends_of(const std::vector<PoseConstraint>& loops) {
  std::vector<LoopEnds> ends;
  ends.reserve(loops.size());
  for (const PoseConstraint& loop : loops) ends.emplace_back(loop.a, loop.b);
  return ends;
}

// The measurement by the keypoints that the map has now: without what it names of others.
LoopMeasurement by_present_keypoints(const MapSnapshot& map, LoopMeasurement loop) {
  if (loop.observations != nullptr && loop.observations != map.at(loop.keyframe).observations) {
    loop.new_observations.clear();
  }
  loop.observations.reset();
  return loop;
}

// How far the map's newer keyframe is from where the loop sees it.
void write_discrepancy(const MapSnapshot& map, const LoopMeasurement& loop, LoopOutcome& outcome) {
  const Rigid3d by_map =
      map.at(loop.keyframe).cam_from_world * inverse(map.at(loop.match).cam_from_world);
  const Rigid3d off = inverse(without_scale(loop.keyframe_from_match)) * by_map;
  outcome.translation = off.translation().norm();
  outcome.rotation = so3_log(off.rotation()).norm();
}

}  // namespace

void LoopUpdate::run() {
  if (map_ == nullptr) return;
  const auto start = std::chrono::steady_clock::now();
  closure_ = close_loop(*map_, loops_, closed_, options_);
  moved_.move(closure_.correction.cam_from_world, closure_.correction.point_in_world);
  seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

LoopOutcome Backend::close(const LoopMeasurement& loop) {
  LoopUpdate update = begin_close(loop);
  update.run();
  return end_close(std::move(update));
}

LoopUpdate Backend::begin_close(const LoopMeasurement& loop) {
  require_no_update("begin_close");
  updating_ = true;
  LoopUpdate update;
  if (view().find(loop.keyframe) == nullptr || view().find(loop.match) == nullptr) return update;
  write_discrepancy(view(), loop, update.outcome_);
  bring_together(loop);
  refused_.push_back(by_present_keypoints(view(), loop));  // until it is taken
  update.loops_ = constraints_of(refused_);
  update.closed_ = ends_of(closed_);
  update.options_ = options_.loops;
  for (const LoopMeasurement& one : refused_) update.options_.graph.with_scale |= one.with_scale;
  update.map_ = map_.snapshot();
  update.moved_ = map_.branch();
  return update;
}

LoopOutcome Backend::end_close(LoopUpdate update) {
  require_update("end_close");
  if (update.map_ == nullptr) return update.outcome_;
  const bool taken = !update.closure_.taken.empty();
  update.outcome_.chi2 = update.closure_.chi2;
  update.outcome_.loops = static_cast<int>(update.closure_.taken.size());
  update.outcome_.end = taken ? LoopEnd::kClosed : LoopEnd::kImplausible;
  if (taken) take_in(update);
  const auto most = static_cast<std::size_t>(options_.max_refused_loops);
  while (refused_.size() > most) refused_.erase(refused_.begin());
  return update.outcome_;
}

// The measurements are weighted and the map is moved before its sides become one: merged, they
// would be neither here nor there.
void Backend::take_in(LoopUpdate& update) {
  const LoopGraphOptions& options = update.options_.graph;
  const std::vector<std::size_t>& indices = update.closure_.taken;
  std::vector<LoopMeasurement> taken;
  moved_by_others(false);
  for (const std::size_t i : indices) {
    PoseConstraint loop = constraint_of(refused_[i]);
    loop.information = motion_information(*update.map_, loop.a, loop.b, loop.a_from_b, options);
    closed_.push_back(loop);
    if (smoother_) smoother_->add_loop(loop);
    taken.push_back(refused_[i]);
  }
  for (auto i = indices.rbegin(); i != indices.rend(); ++i) {
    refused_.erase(refused_.begin() + static_cast<std::ptrdiff_t>(*i));
  }
  BundleResult& correction = update.closure_.correction;
  const auto before = snapshot();
  take_in_moves(*update.map_, std::move(update.moved_), correction);
  remember_move(*before, correction);
  if (options.with_scale) forget_moves(moves_.size());  // motions have another size now
  for (const LoopMeasurement& loop : taken) merge_sides(loop);
}

void Backend::remember_move(const MapSnapshot& before, const BundleResult& correction) {
  moves_.push_back(move_of(before, correction));
  if (moves_.size() > kMaxMoves) forget_moves(1);
}

void Backend::move(const BundleResult& correction) {
  remember_move(view(), correction);
  map_.move(correction.cam_from_world, correction.point_in_world);
}

// Where the loop's ends lie in different components, only it says where these lie against one
// another: one of them moves as a whole.
void Backend::bring_together(const LoopMeasurement& loop) {
  const KeyframeId newer_part = view().at(loop.keyframe).component;
  const KeyframeId older_part = view().at(loop.match).component;
  if (newer_part == older_part) return;
  const KeyframeId origins = view().at(view().origin()).component;
  const auto sizes = component_sizes(view());
  const bool newer_moves = older_part == origins ||
                           (newer_part != origins && sizes.at(newer_part) <= sizes.at(older_part));
  const Rigid3d newer_from_older = without_scale(loop.keyframe_from_match);
  const Rigid3d newer = view().at(loop.keyframe).cam_from_world;
  const Rigid3d older = view().at(loop.match).cam_from_world;
  const Rigid3d old_from_new_world = newer_moves
                                         ? inverse(newer) * newer_from_older * older
                                         : inverse(older) * inverse(newer_from_older) * newer;
  const Rigid3d new_from_old_world = inverse(old_from_new_world);
  const KeyframeId goes = newer_moves ? newer_part : older_part;
  BundleResult correction;
  for (const KeyframeId id : view().keyframe_ids()) {
    if (view().at(id).component != goes) continue;
    correction.cam_from_world.emplace_back(id, view().at(id).cam_from_world * old_from_new_world);
  }
  for (const LandmarkId id : view().landmark_ids()) {
    const Landmark& landmark = view().at(id);
    if (view().at(landmark.observations.front().keyframe).component != goes) continue;
    correction.point_in_world.emplace_back(id, new_from_old_world * landmark.point_in_world);
  }
  move(correction);
}

void Backend::merge_sides(const LoopMeasurement& loop) {
  MapEdit edit;
  edit.merged = loop.same;
  edit.new_observations = loop.new_observations;
  map_.apply(edit);
  map_.set_keep(loop.keyframe);
  map_.set_keep(loop.match);
  map_.join_components(loop.keyframe, loop.match);
}

}  // namespace hybrid_slam
