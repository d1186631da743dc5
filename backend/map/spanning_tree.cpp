#include "backend/map/spanning_tree.h"

#include <algorithm>
#include <vector>

#include "backend/map/covisibility.h"

namespace hybrid_slam {

namespace {

void hang(MapTables& tables, KeyframeId child, KeyframeId parent) {
  tables.keyframes.edit(child.value).parent = parent;
  auto& children = tables.keyframes.edit(parent.value).children;
  children.insert(std::lower_bound(children.begin(), children.end(), child), child);
}

// The keyframe itself, or the nearest ancestor of an erased one that is left; else the origin.
KeyframeId living(const MapTables& tables, KeyframeId id) {
  while (const ErasedKeyframe* erased = tables.erased.find(id.value)) id = erased->parent;
  return tables.keyframes.find(id.value) != nullptr ? id : tables.origin;
}

struct Adoption {
  std::size_t orphan = 0;
  KeyframeId parent;
  int shared = -1;
};

Adoption best_adoption(const MapTables& tables, const std::vector<KeyframeId>& orphans,
                       const std::vector<KeyframeId>& parents) {
  Adoption best;
  for (std::size_t i = 0; i < orphans.size(); ++i) {
    const Keyframe& orphan = *tables.keyframes.find(orphans[i].value);
    for (const KeyframeId parent : parents) {
      const int shared = shared_landmarks(orphan, parent);
      if (shared > best.shared) best = {i, parent, shared};
    }
  }
  return best;
}

}  // namespace

void attach_to_tree(MapTables& tables, KeyframeId id, KeyframeId reference) {
  KeyframeId parent = strongest_covisible(*tables.keyframes.find(id.value));
  if (!parent.valid()) parent = living(tables, reference);
  hang(tables, id, parent);
}

void detach_from_tree(MapTables& tables, KeyframeId id) {
  const Keyframe& keyframe = *tables.keyframes.find(id.value);
  const KeyframeId parent = keyframe.parent;
  std::vector<KeyframeId> orphans = keyframe.children;
  const Rigid3d& parent_from_world = tables.keyframes.find(parent.value)->cam_from_world;
  tables.erased.insert(id.value, {parent, keyframe.cam_from_world * inverse(parent_from_world)});

  auto& siblings = tables.keyframes.edit(parent.value).children;
  siblings.erase(std::find(siblings.begin(), siblings.end(), id));
  std::vector<KeyframeId> parents{parent};
  while (!orphans.empty()) {
    const Adoption adoption = best_adoption(tables, orphans, parents);
    const KeyframeId child = orphans[adoption.orphan];
    orphans.erase(orphans.begin() + static_cast<std::ptrdiff_t>(adoption.orphan));
    hang(tables, child, adoption.parent);
    parents.push_back(child);
  }
}

}  // namespace hybrid_slam
