#pragma once

#include "backend/map/map_file_format.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {

// An orbit over the seafloor, seen by a stereo pair and, if asked for, a fisheye.
SyntheticSceneOptions small_orbit(int times, bool fisheye);

// Of these frames of the scene (every `stride`-th from `first` on, before `last`), with true poses
// and exact odometry.
FilledMap map_of_frames(const SyntheticScene& scene, std::size_t first, std::size_t last,
                        std::size_t stride);

// A map of these tables, right or wrong.
MapTables tables_of(Map& map);

}  // namespace hybrid_slam
