#pragma once

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

// Checks that two maps are the same in every bit that can be seen, derived attributes included.
void check_same_map(const MapSnapshot& a, const MapSnapshot& b);

}  // namespace hybrid_slam
