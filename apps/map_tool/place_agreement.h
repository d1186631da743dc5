#pragma once

#include "backend/map/loop_measurement.h"
#include "backend/map/map_snapshot.h"
#include "backend/problem/loop_closure.h"

namespace hybrid_slam {

// Whether two places, each seen from two components (the same two), say the same of where these lie
// against one another: by no more than the drift of the loop graph over the way between the places,
// inside of each component.
bool places_agree(const MapSnapshot& map, const LoopMeasurement& a, const LoopMeasurement& b,
                  const LoopClosureOptions& options);

// Landmarks of the older side that `b` shows and `a` does not.
std::size_t landmarks_of_its_own(const LoopMeasurement& b, const LoopMeasurement& a);

}  // namespace hybrid_slam
