#pragma once

#include <functional>
#include <span>
#include <vector>

#include "backend/map/map.h"

namespace hybrid_slam {

// What of a map goes into another one.
struct MapPart {
  const MapSnapshot* map = nullptr;
  std::vector<KeyframeId> keyframes;  // ascending; all are in the map
  // Whether a landmark goes along. Empty: all do. One that is not seen enough by these keyframes
  // (landmark_attributes.h, is_supported) stays behind anyhow.
  std::function<bool(const Landmark&)> takes;
};

// One map of parts of maps. Keyframes and landmarks count from 0, part by part, in the order that
// they had. Poses, points, measurements and counters are taken as they are, each in the world of
// its own map: nothing is moved. Cameras of the same numbers are one; of what was found out about
// it (RigCorrection), what the part of its newest keyframe says holds. Frames of a part are counted
// on from those of the parts before, their times stay. What is left out leaves nothing behind:
// odometry goes on over a keyframe that is gone, and the spanning tree is made anew.
//
// Parts share nothing, so each is at least one component (components.h), whose first stereo
// keyframe has loose odometry from the one before. Throws std::invalid_argument if the parts hold
// descriptors of several kinds.
Map assemble_map(std::span<const MapPart> parts);

}  // namespace hybrid_slam
