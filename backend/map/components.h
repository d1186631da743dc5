#pragma once

#include <cstddef>
#include <map>

#include "backend/map/map_snapshot.h"

// A map may consist of several components: parts that nothing joins but a guess (a keyframe whose
// odometry is_loose()). Where tracking was lost and no place was recognised, the next component
// begins. Inside of one all is as in a map of its own; where it lies against the others is not
// known until a loop joins two of them, which makes them one.

namespace hybrid_slam {

// Keyframes in each component, by its name, which is that of the keyframe that it began with.
std::map<KeyframeId, std::size_t> component_sizes(const MapSnapshot& map);

// Names the components anew by what joins keyframes: landmarks that both see, odometry that is not
// loose and, for those that have neither, their parent. For a map that was read from a file.
void name_components(MapTables& tables);

}  // namespace hybrid_slam
