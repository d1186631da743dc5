#pragma once

#include <vector>

#include "backend/map/map_snapshot.h"
#include "backend/problem/factor_graph.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// A part of a map as a factor graph, and whose its rows are.
struct MapGraph {
  FactorGraph graph;
  std::vector<KeyframeId> frames;  // as graph.frames or, with scale, as graph.similarities
  std::vector<LandmarkId> points;  // as graph.points
  std::vector<LandmarkObservation> observations;  // as graph.observations: by landmark
};

// The part that a config names: ids that the map does not have are left out, and so are
// observations between a fixed pose and a fixed landmark, and constraints of absent keyframes.
MapGraph make_graph(const MapSnapshot& map, const ProblemConfig& config);

}  // namespace hybrid_slam
