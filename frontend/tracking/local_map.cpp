#include "frontend/tracking/local_map.h"

#include <algorithm>
#include <map>
#include <unordered_set>
#include <utility>

namespace hybrid_slam {
namespace {

// Keyframes by the number of `tracked` landmarks they see, most first (ties: lower id).
std::vector<std::pair<int, KeyframeId>> count_observers(const MapSnapshot& map,
                                                        const std::vector<LandmarkId>& tracked) {
  std::map<KeyframeId, int> votes;
  for (const LandmarkId id : tracked) {
    const Landmark* landmark = id.valid() ? map.find(id) : nullptr;
    if (landmark != nullptr) {
      for (const Observation& observation : landmark->observations) {
        ++votes[observation.keyframe];
      }
    }
  }
  std::vector<std::pair<int, KeyframeId>> ranked;
  ranked.reserve(votes.size());
  for (const auto& [id, count] : votes) {
    ranked.emplace_back(count, id);
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
  std::unordered_set<LandmarkId> seen;
  for (const KeyframeId keyframe : local.keyframes) {
    for (const LandmarkId id : map.at(keyframe).landmarks) {
      if (id.valid() && seen.insert(id).second) {
        local.landmarks.push_back(id);
      }
    }
  }
  return local;
}

}  // namespace hybrid_slam
