#pragma once

#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/matching/keypoint_grid.h"

namespace hybrid_slam {

// A keyframe to look for landmarks in. Refers to the map.
struct KeyframeView {
  KeyframeView(const MapSnapshot& map, KeyframeId id);

  const Keyframe& keyframe;
  const Camera& camera;
  const FrameObservations& observations;
  KeypointGrid grid;
};

// One end of a loop: a keyframe and what its covisible keyframes know of the place.
struct LoopSide : KeyframeView {
  // At most `max_neighbours` keyframes, the strongest, that share `min_shared` landmarks with it.
  LoopSide(const MapSnapshot& map, KeyframeId id, int max_neighbours, int min_shared);

  std::vector<KeyframeId> neighbours;  // strongest first
  std::vector<LandmarkId> landmarks;   // of the keyframe and of them, ascending
  // It or a covisible keyframe is a stereo pair. All count here: the strongest neighbours of a
  // fisheye, which sees more, are fisheyes.
  bool metric = false;
};

}  // namespace hybrid_slam
