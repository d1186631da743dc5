#include <utility>

#include "backend/map/landmark_attributes.h"
#include "backend/map/map.h"

// A map that is moved beside, while its owner goes on.

namespace hybrid_slam {

namespace {

// Brings what changed in `now` since `then` into `moved`. Of what is in both, `keep` takes over
// what the move decides. `changed` is called with the value of each that `now` has.
template <typename T, typename Keep, typename Changed>
void bring_changes(const PersistentTable<T>& then, const PersistentTable<T>& now,
                   PersistentTable<T>& moved, Keep&& keep, Changed&& changed) {
  now.for_each_change(then, [&](std::uint64_t index) {
    const T* const value = now.find(index);
    if (value == nullptr) {
      moved.erase(index);
    } else if (T* const there = moved.edit_if(index)) {
      T next = *value;
      keep(next, *there);
      *there = std::move(next);
      changed(*there);
    } else {
      changed(moved.insert(index, *value));
    }
  });
}

}  // namespace

Map Map::branch() {
  Map copy;
  copy.view_.tables_ = view_.tables_.share();
  return copy;
}

void Map::take_in_moves(const MapSnapshot& then, Map branch) {
  MapTables& now = view_.tables_;
  MapTables& moved = branch.view_.tables_;
  bring_changes(
      then.tables_.keyframes, now.keyframes, moved.keyframes,
      [](Keyframe& next, const Keyframe& there) { next.cam_from_world = there.cam_from_world; },
      [](Keyframe&) {});
  now.keyframes = std::move(moved.keyframes);
  CameraCenters centers(now);
  bring_changes(
      then.tables_.landmarks, now.landmarks, moved.landmarks,
      [](Landmark& next, const Landmark& there) { next.point_in_world = there.point_in_world; },
      [&](Landmark& landmark) { update_geometry(now, centers, landmark); });
  now.landmarks = std::move(moved.landmarks);
}

}  // namespace hybrid_slam
