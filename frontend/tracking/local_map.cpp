#include "frontend/tracking/local_map.h"

#include <algorithm>
#include <cstdint>
#include <unordered_set>
#include <utility>

#include "backend/map/marked_landmarks.h"
#include "backend/map/prefetch.h"

namespace hybrid_slam {
namespace {

// Keyframes by the number of `tracked` landmarks they see, most first (ties: lower id).
std::vector<std::pair<int, KeyframeId>> count_observers(const MapSnapshot& map,
                                                        const std::vector<LandmarkId>& tracked) {
  std::vector<int> votes(map.next_keyframe_id().value, 0);
  const auto find = [&](std::size_t i) {
    return i < tracked.size() && tracked[i].valid() ? map.find(tracked[i]) : nullptr;
  };
  for (std::size_t i = 0; i < tracked.size(); ++i) {
    if (const Landmark* next = find(i + 2 * kPrefetchAhead)) prefetch(&next->observations);
    if (const Landmark* next = find(i + kPrefetchAhead)) prefetch_all(next->observations);
    const Landmark* landmark = find(i);
    if (landmark != nullptr) {
      for (const Observation& observation : landmark->observations) {
        ++votes[observation.keyframe.value];
      }
    }
  }
  std::vector<std::pair<int, KeyframeId>> ranked;
  for (std::uint32_t id = 0; id < votes.size(); ++id) {
    if (votes[id] > 0) ranked.emplace_back(votes[id], KeyframeId(id));
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  return ranked;
}

void add_neighbours(const MapSnapshot& map, const LocalMapOptions& options, LocalMap& local) {
  std::unordered_set<KeyframeId> seen(local.keyframes.begin(), local.keyframes.end());
  const auto limit = static_cast<std::size_t>(options.max_keyframes);
  const std::size_t direct = local.keyframes.size();
  const auto add = [&](KeyframeId id) {
    if (id.valid() && local.keyframes.size() < limit && seen.insert(id).second) {
      local.keyframes.push_back(id);
    }
  };
  for (std::size_t i = 0; i < direct && local.keyframes.size() < limit; ++i) {
    const Keyframe& keyframe = map.at(local.keyframes[i]);
    for (const Covisible& covisible :
         map.covisible(keyframe.id, 1, static_cast<std::size_t>(options.neighbours_per_keyframe))) {
      add(covisible.id);
    }
    for (const KeyframeId child : keyframe.children) {
      add(child);
    }
    add(keyframe.parent);
  }
}

}  // namespace

std::string LocalMapOptions::validate() const {
  if (max_keyframes < 1 || neighbours_per_keyframe < 0) {
    return "local map: max_keyframes must be positive, neighbours_per_keyframe not negative";
  }
  return {};
}

LocalMap make_local_map(const MapSnapshot& map, const std::vector<LandmarkId>& tracked,
                        const LocalMapOptions& options) {
  LocalMap local;
  for (const auto& [count, id] : count_observers(map, tracked)) {
    if (local.keyframes.size() >= static_cast<std::size_t>(options.max_keyframes)) {
      break;
    }
    local.keyframes.push_back(id);
  }
  if (local.keyframes.empty()) {
    return local;
  }
  local.reference = local.keyframes.front();
  add_neighbours(map, options, local);
  MarkedLandmarks seen(map.next_landmark_id().value);
  for (const KeyframeId keyframe : local.keyframes) {
    for (const LandmarkId id : map.at(keyframe).landmarks) {
      if (seen.mark(id)) local.landmarks.push_back(id);
    }
  }
  return local;
}

}  // namespace hybrid_slam
