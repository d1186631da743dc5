#pragma once

#include <string>
#include <vector>

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

struct LocalMapOptions {
  int max_keyframes = 80;
  int neighbours_per_keyframe = 10;  // covisible keyframes added for each one that shares landmarks

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// The part of the map around a frame.
struct LocalMap {
  KeyframeId reference;               // shares most landmarks with the frame; invalid if none does
  std::vector<KeyframeId> keyframes;  // most shared first, then their neighbours
  std::vector<LandmarkId> landmarks;  // theirs, each once
};

// Keyframes that share landmarks with `tracked` (entries may be invalid or gone), of both camera
// kinds, their covisible neighbours and relatives in the spanning tree, and all their landmarks.
LocalMap make_local_map(const MapSnapshot& map, const std::vector<LandmarkId>& tracked,
                        const LocalMapOptions& options);

}  // namespace hybrid_slam
