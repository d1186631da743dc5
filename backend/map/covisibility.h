#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "backend/map/ids.h"
#include "backend/map/keyframe.h"
#include "backend/map/landmark.h"
#include "backend/map/persistent_table.h"

namespace hybrid_slam {

// Changes to the covisibility graph, gathered while observations come and go and written at once:
// a landmark with ten observers alters twenty edges, mostly the same ones as its neighbours.
class CovisibilityChanges {
 public:
  // The keyframe gains (+1) or loses (-1) a landmark which `others` see (itself left out).
  void add(KeyframeId keyframe, const std::vector<Observation>& others, int change);

  // Adds the changes to the edges' weights; edges of weight zero go. Every keyframe named must
  // exist. Empty afterwards.
  void write(PersistentTable<Keyframe>& keyframes);

 private:
  std::unordered_map<std::uint64_t, int> changes_;  // by (lower id, higher id)
};

// Landmarks shared by two keyframes; 0 without an edge.
int shared_landmarks(const Keyframe& keyframe, KeyframeId other);

// The other end of the strongest edge (ties: lower id); invalid without one.
KeyframeId strongest_covisible(const Keyframe& keyframe);

}  // namespace hybrid_slam
