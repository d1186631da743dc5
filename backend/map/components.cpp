#include "backend/map/components.h"

#include <algorithm>
#include <vector>

#include "backend/map/map_tables.h"
#include "backend/map/odometry.h"

namespace hybrid_slam {
namespace {

// Disjoint sets of keyframes, each named by its lowest id.
class Sets {
 public:
  KeyframeId name_of(KeyframeId id) {
    auto found = above_.try_emplace(id, id).first;
    while (found->second != id) {
      id = found->second;
      found = above_.try_emplace(id, id).first;
    }
    return id;
  }
  void join(KeyframeId a, KeyframeId b) {
    const KeyframeId first = name_of(a);
    const KeyframeId second = name_of(b);
    above_[std::max(first, second)] = std::min(first, second);
  }

 private:
  std::map<KeyframeId, KeyframeId> above_;
};

}  // namespace

std::map<KeyframeId, std::size_t> component_sizes(const MapSnapshot& map) {
  std::map<KeyframeId, std::size_t> sizes;
  for (const KeyframeId id : map.keyframe_ids()) ++sizes[map.at(id).component];
  return sizes;
}

void name_components(MapTables& tables) {
  Sets sets;
  std::vector<KeyframeId> ids;
  tables.keyframes.for_each([&](std::uint64_t, const Keyframe& keyframe) {
    ids.push_back(keyframe.id);
    const bool odometry = keyframe.odometry != nullptr;
    const bool firm = odometry && !is_loose(*keyframe.odometry);
    if (firm) sets.join(keyframe.id, keyframe.odometry->previous);
    for (const Covisible& other : keyframe.covisible) sets.join(keyframe.id, other.id);
    if (!odometry && keyframe.covisible.empty() && keyframe.parent.valid()) {
      sets.join(keyframe.id, keyframe.parent);
    }
  });
  for (const KeyframeId id : ids) tables.keyframes.edit(id.value).component = sets.name_of(id);
}

}  // namespace hybrid_slam
