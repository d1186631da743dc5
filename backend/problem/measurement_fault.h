#pragma once

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// What is wrong with the numbers of a measurement; null if they can be used. Indices are not looked
// at, except that an edge must not join a frame to itself.
const char* measurement_fault(const GraphObservation& observation, const Camera& camera);
const char* measurement_fault(const GraphEdge& edge);

}  // namespace hybrid_slam
