#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "backend/incremental/incremental_solver.h"
#include "backend/incremental/map_smoother.h"

// What a MapSmoother tells its map.

namespace hybrid_slam {

namespace {

// Of the tree that is handed out for covariances: 0.8 MB at most, and a frame that needs all of it
// solves for six columns in half a millisecond. A map without loops needs a tenth of that.
constexpr std::size_t kMaxCovarianceNumbers = 100000;

// The newest keyframe of each camera, then those that share landmarks with them, most first.
std::vector<KeyframeId> newest_and_neighbours(const MapSnapshot& map) {
  std::vector<KeyframeId> found;
  std::vector<char> has(map.camera_count(), 0);
  for (std::uint32_t id = map.next_keyframe_id().value; id-- > 0;) {
    const Keyframe* keyframe = map.find(KeyframeId(id));
    if (keyframe == nullptr || has[keyframe->observations->camera.value]) continue;
    has[keyframe->observations->camera.value] = 1;
    found.push_back(keyframe->id);
    if (found.size() == has.size()) break;
  }
  std::vector<Covisible> neighbours;
  for (const KeyframeId id : found) {
    const std::vector<Covisible>& those = map.at(id).covisible;
    neighbours.insert(neighbours.end(), those.begin(), those.end());
  }
  std::stable_sort(neighbours.begin(), neighbours.end(),
                   [](const Covisible& a, const Covisible& b) {
                     return a.shared_landmarks > b.shared_landmarks;
                   });
  for (const Covisible& one : neighbours) found.push_back(one.id);
  return found;
}

// Landmarks that these keyframes see, and these, once each.
std::vector<LandmarkId> seen_by(const MapSnapshot& map, const std::vector<KeyframeId>& keyframes,
                                std::vector<LandmarkId> seen) {
  for (const KeyframeId id : keyframes) {
    const std::vector<LandmarkId>& those = map.at(id).landmarks;
    seen.insert(seen.end(), those.begin(), those.end());
  }
  std::sort(seen.begin(), seen.end());
  seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
  return seen;
}

}  // namespace

std::shared_ptr<const KeyframeCovariances> MapSmoother::covariances(const MapSnapshot& map) const {
  std::vector<std::uint32_t> poses;
  for (const KeyframeId id : newest_and_neighbours(map)) {
    if (id.value < pose_of_.size() && pose_of_[id.value] != kNone) {
      poses.push_back(pose_of_[id.value]);
    }
  }
  IncrementalSolver::PosePaths found = solver_->paths(poses, kMaxCovarianceNumbers);
  std::vector<KeyframeCovariances::Known> known;
  for (const auto& pose : found.poses) {
    known.push_back({keyframe_of_[pose.pose], pose.at, pose.by_variable});
  }
  std::sort(known.begin(), known.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return std::make_shared<const KeyframeCovariances>(map.origin(), std::move(found.paths),
                                                     std::move(known));
}

void MapSmoother::set_outliers_aside(const MapSnapshot& map, KeyframeId newest,
                                     BundleResult& result) {
  const IncrementalOptions& options = options_.solver;
  doubted_.clear();
  for (const LandmarkId id : map.at(newest).landmarks) {
    KnownLandmark* const landmark = landmarks_.find(id.value);
    if (landmark == nullptr) continue;
    std::erase_if(landmark->views, [&](const View& view) {
      if (view.in_solver == kNone) return false;
      const bool stereo = map.at(view.seen.keyframe).observations->has_right(view.seen.keypoint);
      if (solver_->chi2(view.in_solver) <= (stereo ? options.chi2_stereo : options.chi2_mono)) {
        return false;
      }
      solver_->remove_observation(view.in_solver);
      result.outliers.push_back({id, view.seen});
      doubted_.push_back(id);
      return true;  // forgotten: where the map takes it in again, it is a new one
    });
  }
  std::sort(doubted_.begin(), doubted_.end());
}

void MapSmoother::write(const MapSnapshot& map, const std::vector<KeyframeId>& keyframes,
                        std::vector<LandmarkId> seen, BundleResult& result) {
  for (const KeyframeId id : keyframes) {
    const std::uint32_t pose = pose_of_[id.value];
    told_[pose] = solver_->pose(pose);
    result.cam_from_world.emplace_back(id, told_[pose]);
  }
  std::vector<LandmarkId> ids = seen_by(map, keyframes, std::move(seen));
  std::erase_if(ids, [this](LandmarkId id) { return landmarks_.find(id.value) == nullptr; });
  std::vector<std::uint32_t> points;
  points.reserve(ids.size());
  for (const LandmarkId id : ids) points.push_back(landmarks_.find(id.value)->point);
  const std::vector<Eigen::Vector3d> estimates = solver_->place(points);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (estimates[i].allFinite()) result.point_in_world.emplace_back(ids[i], estimates[i]);
  }
}

// Of the keyframes behind the estimate those that the newest ones share landmarks with, at once.
// Others wait until they are off by more, which each update's noise does not do, and for their
// turn, farthest off first: an update writes about as much of them as of what is near, or each
// would cost as much as the whole map while a loop's last tenths of a millimetre settle.
void MapSmoother::write_estimate(const MapSnapshot& map, const std::vector<std::uint32_t>& moved,
                                 std::span<const KeyframeId> newest, bool all,
                                 BundleResult& result) {
  std::vector<KeyframeId> near = newest_and_neighbours(map);
  near.insert(near.end(), newest.begin(), newest.end());
  std::sort(near.begin(), near.end());
  std::vector<std::uint32_t> behind;
  std::set_union(behind_.begin(), behind_.end(), moved.begin(), moved.end(),
                 std::back_inserter(behind));
  std::vector<KeyframeId> at_once;
  std::vector<std::pair<double, KeyframeId>> others;
  behind_.clear();
  for (const std::uint32_t pose : behind) {
    const Keyframe* keyframe = map.find(keyframe_of_[pose]);
    if (keyframe == nullptr) continue;
    const double off = off_by(*keyframe);
    if (!(off > options_.min_motion)) continue;
    if (all || std::binary_search(near.begin(), near.end(), keyframe->id)) {
      at_once.push_back(keyframe->id);
    } else if (off <= options_.min_far_motion) {
      behind_.push_back(pose);
    } else {
      others.emplace_back(-off, keyframe->id);
    }
  }
  write(map, at_once, seen_by(map, {newest.begin(), newest.end()}, {}), result);

  std::sort(others.begin(), others.end());
  std::size_t enough = 0;
  for (const KeyframeId id : near) enough += map.at(id).landmarks.size();
  std::vector<KeyframeId> next;
  for (std::size_t i = 0, seen = 0; i < others.size(); ++i) {
    const KeyframeId id = others[i].second;
    seen += map.at(id).landmarks.size();
    if (i == 0 || seen <= enough) {
      next.push_back(id);
    } else {
      behind_.push_back(pose_of_[id.value]);
    }
  }
  write(map, next, {}, result);
  std::sort(behind_.begin(), behind_.end());
}

BundleResult MapSmoother::rest(const MapSnapshot& map) {
  BundleResult result;
  std::vector<KeyframeId> keyframes;
  for (const std::uint32_t pose : std::exchange(behind_, {})) {
    const Keyframe* keyframe = map.find(keyframe_of_[pose]);
    if (keyframe != nullptr && stayed(*keyframe)) keyframes.push_back(keyframe->id);
  }
  write(map, keyframes, {}, result);
  return result;
}

// By how much the map is behind the estimate [m, rad].
double MapSmoother::off_by(const Keyframe& keyframe) const {
  return distance(solver_->pose(pose_of_[keyframe.id.value]), keyframe.cam_from_world);
}

// [m, rad]
double MapSmoother::distance(const Rigid3d& a, const Rigid3d& b) {
  return (a.params - b.params).lpNorm<Eigen::Infinity>();
}

// Nobody has moved the keyframe since the last update.
bool MapSmoother::stayed(const Keyframe& keyframe) const {
  const Keyframe* before = known_map_->find(keyframe.id);
  return before != nullptr && before->cam_from_world.params == keyframe.cam_from_world.params;
}

}  // namespace hybrid_slam
