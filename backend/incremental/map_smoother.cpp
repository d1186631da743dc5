#include "backend/incremental/map_smoother.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "backend/incremental/incremental_solver.h"
#include "backend/map/dropped_features.h"
#include "backend/map/prefetch.h"
#include "backend/problem/odometry_constraints.h"

namespace hybrid_slam {

namespace {

// What the share of odometry that counts may be off by before its edge is made anew. The odometer
// knows its own noise no better, from some tens of matches.
constexpr double kShareTolerance = 0.1;

// One motion between the same keyframes, or none; whatever became of the keypoints.
bool say_the_same(const Odometry* a, const Odometry* b) {
  if (a == nullptr || b == nullptr) return a == b;
  return a->previous == b->previous && a->motion.b_from_a.params == b->motion.b_from_a.params &&
         a->motion.covariance == b->motion.covariance;
}

}  // namespace

std::string MapSmootherOptions::validate() const {
  if (!(min_motion >= 0)) return "min_motion must not be negative";
  if (!(min_far_motion >= min_motion)) return "min_far_motion must not be less than min_motion";
  return solver.validate();
}

MapSmoother::MapSmoother(const MapSmootherOptions& options)
    : options_(options), solver_(std::make_unique<IncrementalSolver>(options.solver)) {}

MapSmoother::~MapSmoother() = default;

BundleResult MapSmoother::update(std::shared_ptr<const MapSnapshot> map,
                                 std::span<const KeyframeId> newest, const std::stop_token& stop) {
  const auto start = std::chrono::steady_clock::now();
  // A loop, or a map that is new to the smoother, is worth telling all of it at once.
  const bool tell_all = known_map_ == nullptr || !new_loops_.empty();
  follow_moves(*map);
  take_in_keyframes(*map, newest.back());
  take_in_loops(*map);
  const std::vector<LandmarkId> changed =
      known_map_ != nullptr ? map->changed_landmarks(*known_map_) : map->landmark_ids();
  for (std::size_t i = 0; i < changed.size(); ++i) {
    if (known_map_ != nullptr) fetch(*map, changed, i);
    if (known_map_ == nullptr || is_news(*map, changed[i])) take_in_landmark(*map, changed[i]);
  }
  take_in_odometry(*map);
  const UpdateSummary updated = solver_->update(stop);

  forget_marginalized(*map, updated.marginalized);
  BundleResult result;
  for (const KeyframeId id : newest) set_outliers_aside(*map, id, result);
  write_estimate(*map, updated.moved, newest, tell_all, result);
  let_keyframes_go(*map);
  known_map_ = std::move(map);
  BundleSummary& summary = result.summary;
  summary.end = updated.pending == 0 ? SolveEnd::kConverged : SolveEnd::kIterationLimit;
  summary.text = std::to_string(updated.pending) + " terms wait to be linearised anew";
  summary.iterations = updated.steps;
  summary.variable_poses = static_cast<int>(updated.poses);
  summary.variable_landmarks = static_cast<int>(result.point_in_world.size());
  summary.outliers = static_cast<int>(result.outliers.size());
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

// What it sees without the map knowing of it any more gets a keypoint that none has: the update
// takes it out.
void MapSmoother::renumber(KeyframeId keyframe, std::span<const std::uint32_t> kept) {
  const Keyframe* known = known_map_ != nullptr ? known_map_->find(keyframe) : nullptr;
  if (known == nullptr) return;
  for (const LandmarkId id : known->landmarks) {
    KnownLandmark* const landmark = landmarks_.find(id.value);
    if (landmark == nullptr) continue;
    for (View& view : landmark->views) {
      if (view.seen.keyframe == keyframe) {
        view.seen.keypoint = new_keypoint(kept, view.seen.keypoint).value_or(kNone);
      }
    }
  }
}

// A loop was closed, or everything adjusted: the map is no longer where the last result left it.
// The estimate moves as the map did, so that what the map was not told yet is not lost.
void MapSmoother::follow_moves(const MapSnapshot& map) {
  if (known_map_ == nullptr) return;
  std::vector<std::pair<std::uint32_t, Rigid3d>> moved;
  for (const KeyframeId id : map.changed_keyframes(*known_map_)) {
    const Keyframe* keyframe = map.find(id);
    if (keyframe == nullptr || id.value >= pose_of_.size() || id == map.origin()) continue;
    if (stayed(*keyframe)) continue;  // the map has yet to follow the estimate
    const std::uint32_t pose = pose_of_[id.value];
    Rigid3d& told = told_[pose];
    if (!(distance(told, keyframe->cam_from_world) > options_.min_motion)) continue;
    moved.emplace_back(pose, solver_->pose(pose) * inverse(told) * keyframe->cam_from_world);
    told = keyframe->cam_from_world;
  }
  if (!moved.empty()) solver_->move_poses(moved);
}

// All up to this one, in their order.
void MapSmoother::take_in_keyframes(const MapSnapshot& map, KeyframeId last) {
  while (camera_count_ < map.camera_count()) {
    solver_->add_camera(map.camera(CameraId(static_cast<std::uint32_t>(camera_count_++))));
  }
  while (pose_of_.size() <= last.value) {
    const KeyframeId id(static_cast<std::uint32_t>(pose_of_.size()));
    const Keyframe* keyframe = map.find(id);
    pose_of_.push_back(kNone);
    if (keyframe == nullptr) continue;
    const std::uint32_t pose = solver_->add_pose(
        {keyframe->cam_from_world, keyframe->observations->camera.value, id == map.origin()});
    pose_of_.back() = pose;
    if (pose == keyframe_of_.size()) {
      keyframe_of_.emplace_back();
      told_.emplace_back();
    }
    keyframe_of_[pose] = id;
    told_[pose] = keyframe->cam_from_world;
  }
}

// Those that were culled leave their poses to others, or a vehicle that hovers would fill memory.
void MapSmoother::let_keyframes_go(const MapSnapshot& map) {
  if (known_map_ == nullptr || options_.solver.window > 0) return;
  for (const KeyframeId id : map.changed_keyframes(*known_map_)) {
    if (map.find(id) != nullptr || id.value >= pose_of_.size()) continue;
    if (pose_of_[id.value] != kNone) gone_.push_back(id);
    odometry_.erase(id);
  }
  std::erase_if(gone_, [this](KeyframeId id) {
    if (!solver_->remove_pose(pose_of_[id.value])) return false;
    pose_of_[id.value] = kNone;
    return true;
  });
}

void MapSmoother::take_in_loops(const MapSnapshot& map) {
  for (const PoseConstraint& loop : new_loops_) {
    if (map.find(loop.a) == nullptr || map.find(loop.b) == nullptr) continue;
    take_in_keyframes(map, std::max(loop.a, loop.b));
    solver_->add_edge({pose_of_[loop.a.value], pose_of_[loop.b.value], without_scale(loop.a_from_b),
                       loop.information.topLeftCorner<6, 6>(), true});
  }
  new_loops_.clear();
}

// Of keyframes that changed: one that lost or gained landmarks did, too.
void MapSmoother::take_in_odometry(const MapSnapshot& map) {
  const std::vector<KeyframeId> changed =
      known_map_ != nullptr ? map.changed_keyframes(*known_map_) : map.keyframe_ids();
  for (const KeyframeId id : changed) take_in_odometry(map, id);
}

bool MapSmoother::sees_the_same(const MapSnapshot& map, KeyframeId id) const {
  const Keyframe* before = known_map_->find(id);
  return before != nullptr && before->landmarks == map.at(id).landmarks;
}

void MapSmoother::take_in_odometry(const MapSnapshot& map, KeyframeId id) {
  const Keyframe* keyframe = map.find(id);
  const auto odometry = keyframe != nullptr ? keyframe->odometry : nullptr;
  const auto found = odometry_.find(id);
  if (odometry == nullptr && found == odometry_.end()) return;
  KnownOdometry& known = found != odometry_.end() ? found->second : odometry_[id];
  if (odometry != nullptr && known.odometry == odometry && sees_the_same(map, id) &&
      sees_the_same(map, odometry->previous)) {
    return;  // moved, no more
  }
  const double share = odometry != nullptr ? unshared(map, *keyframe) : 0;
  const bool same = say_the_same(known.odometry.get(), odometry.get());
  known.odometry = odometry;
  if (same && std::abs(share - known.share) <= kShareTolerance) return;
  known.share = share;
  if (known.marginalized) return;  // it is in the prior, and must not count twice
  if (known.edge != kNone) solver_->remove_edge(std::exchange(known.edge, kNone));
  const auto constraint =
      odometry != nullptr ? odometry_constraint(*keyframe, share) : std::nullopt;
  if (!constraint) return;
  take_in_keyframes(map, id);
  known.edge = solver_->add_edge({pose_of_[id.value], pose_of_[odometry->previous.value],
                                  without_scale(constraint->a_from_b),
                                  constraint->information.topLeftCorner<6, 6>(), false});
}

// Brings into the cache what is_news() reads of those after the one at `at`.
void MapSmoother::fetch(const MapSnapshot& map, std::span<const LandmarkId> ids,
                        std::size_t at) const {
  for (const MapSnapshot* of : {known_map_.get(), &map}) {
    if (at + 2 * kPrefetchAhead < ids.size()) {
      const Landmark* const landmark = of->find(ids[at + 2 * kPrefetchAhead]);
      if (landmark != nullptr) prefetch(&landmark->observations);
    }
    if (at + kPrefetchAhead < ids.size()) {
      const Landmark* const landmark = of->find(ids[at + kPrefetchAhead]);
      if (landmark != nullptr) prefetch_all(landmark->observations);
    }
  }
}

// Not where a landmark has but moved, as most do that changed, unless views of it were set aside:
// the map may have taken them in again.
bool MapSmoother::is_news(const MapSnapshot& map, LandmarkId id) const {
  const Landmark* before = known_map_->find(id);
  const Landmark* now = map.find(id);
  if (before == nullptr || now == nullptr || before->observations != now->observations) return true;
  return std::binary_search(doubted_.begin(), doubted_.end(), id);
}

// Brings what the solver has of a landmark in line with the map.
void MapSmoother::take_in_landmark(const MapSnapshot& map, LandmarkId id) {
  const Landmark* landmark = map.find(id);
  if (landmark == nullptr) {
    const KnownLandmark* const gone = landmarks_.find(id.value);
    if (gone == nullptr) return;
    solver_->remove_point(gone->point);
    landmarks_.erase(id.value);
    return;
  }
  const auto [known, is_new] = landmarks_.try_emplace(id.value);
  if (is_new) known.point = solver_->add_point(landmark->point_in_world);
  const std::vector<Observation>& wanted = landmark->observations;
  std::erase_if(known.views, [&](const View& view) {
    if (std::binary_search(wanted.begin(), wanted.end(), view.seen)) return false;
    if (view.in_solver != kNone) solver_->remove_observation(view.in_solver);
    return true;
  });
  for (const Observation& seen : wanted) {
    if (std::none_of(known.views.begin(), known.views.end(),
                     [&](const View& view) { return view.seen == seen; })) {
      known.views.push_back({seen, add_observation(map, known.point, seen)});
    }
  }
}

std::uint32_t MapSmoother::add_observation(const MapSnapshot& map, std::uint32_t point,
                                           const Observation& seen) {
  take_in_keyframes(map, seen.keyframe);
  const FrameObservations& frame = *map.at(seen.keyframe).observations;
  const Keypoint& keypoint = frame.features.keypoints[seen.keypoint];
  const double u_right =
      frame.has_right(seen.keypoint) ? frame.u_right[seen.keypoint] : kNoRightMatch;
  return solver_->add_observation(
      {pose_of_[seen.keyframe.value], point, {keypoint.x, keypoint.y, u_right}, keypoint.sigma});
}

// The solver let go of these poses and of all observations of what they see.
void MapSmoother::forget_marginalized(const MapSnapshot& map,
                                      const std::vector<std::uint32_t>& poses) {
  const auto is_gone = [&](KeyframeId id) {
    return std::binary_search(poses.begin(), poses.end(), pose_of_[id.value]);
  };
  for (auto& [id, known] : odometry_) {
    if (poses.empty() || known.edge == kNone) continue;
    if (is_gone(id) || is_gone(known.odometry->previous)) {
      known.edge = kNone;
      known.marginalized = true;
    }
  }
  for (const std::uint32_t pose : poses) {
    const Keyframe* keyframe = map.find(keyframe_of_[pose]);
    if (keyframe == nullptr) continue;
    for (const LandmarkId id : keyframe->landmarks) {
      KnownLandmark* const landmark = landmarks_.find(id.value);
      if (landmark == nullptr) continue;
      for (View& view : landmark->views) view.in_solver = kNone;
    }
  }
}

}  // namespace hybrid_slam
