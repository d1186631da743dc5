#pragma once

#include <stop_token>

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// Solves a config on the values of a map: the engine of every optimisation of a map; they differ in
// their configs alone. Of a loop graph (constraints without landmarks), the landmarks of the map
// follow their reference keyframes. Throws std::invalid_argument if the options are not valid.
BundleResult solve_bundle(const MapSnapshot& map, const ProblemConfig& config,
                          const std::stop_token& stop = {});

}  // namespace hybrid_slam
