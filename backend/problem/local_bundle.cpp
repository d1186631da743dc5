#include "backend/problem/local_bundle.h"

#include <algorithm>
#include <map>

#include "backend/problem/odometry_constraints.h"

namespace hybrid_slam {

namespace {

template <typename Id>
void sort_unique(std::vector<Id>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

std::vector<LandmarkId> landmarks_seen_by(const MapSnapshot& map,
                                          const std::vector<KeyframeId>& keyframes) {
  std::vector<LandmarkId> seen;
  for (const KeyframeId id : keyframes) {
    const auto& landmarks = map.at(id).landmarks;
    std::copy_if(landmarks.begin(), landmarks.end(), std::back_inserter(seen),
                 [](LandmarkId landmark) { return landmark.valid(); });
  }
  sort_unique(seen);
  return seen;
}

// Keyframes outside `inner` (ascending) that see the landmarks, at most `limit`, ascending.
std::vector<KeyframeId> outer_observers(const MapSnapshot& map,
                                        const std::vector<LandmarkId>& landmarks,
                                        const std::vector<KeyframeId>& inner, std::size_t limit) {
  std::map<KeyframeId, int> counts;
  for (const LandmarkId id : landmarks) {
    for (const Observation& observation : map.at(id).observations) ++counts[observation.keyframe];
  }
  for (const KeyframeId id : inner) counts.erase(id);
  std::vector<std::pair<int, KeyframeId>> ranked;
  ranked.reserve(counts.size());
  for (const auto& [id, count] : counts) ranked.emplace_back(-count, id);
  std::sort(ranked.begin(), ranked.end());
  if (ranked.size() > limit) ranked.resize(limit);
  std::vector<KeyframeId> observers;
  observers.reserve(ranked.size());
  for (const auto& [count, id] : ranked) observers.push_back(id);
  std::sort(observers.begin(), observers.end());
  return observers;
}

}  // namespace

ProblemConfig make_local_bundle(const MapSnapshot& map, std::span<const KeyframeId> around,
                                const LocalBundleOptions& options) {
  ProblemConfig config;
  config.options = options.problem;
  std::vector<KeyframeId> inner;
  for (const KeyframeId id : around) {
    const Keyframe* keyframe = map.find(id);
    if (keyframe == nullptr) continue;
    inner.push_back(id);
    for (const Covisible& edge :
         map.covisible(id, options.min_shared_landmarks, options.max_neighbours)) {
      inner.push_back(edge.id);
    }
    if (keyframe->odometry != nullptr) inner.push_back(keyframe->odometry->previous);
  }
  if (inner.empty()) return config;
  sort_unique(inner);
  config.variable_landmarks = landmarks_seen_by(map, inner);
  config.fixed_poses = outer_observers(map, config.variable_landmarks, inner, options.max_fixed);
  // Ids count up: the origin, if it is among them, comes first, and so does the oldest.
  if (inner.front() == map.origin() || config.fixed_poses.empty()) {
    config.fixed_poses.insert(
        std::lower_bound(config.fixed_poses.begin(), config.fixed_poses.end(), inner.front()),
        inner.front());
    inner.erase(inner.begin());
  }
  config.variable_poses = std::move(inner);
  config.constraints = odometry_constraints(map, config.variable_poses);
  return config;
}

}  // namespace hybrid_slam
