#pragma once

#include "backend/map/map_snapshot.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// What a solved loop graph of this map says of it: the keyframes' new poses, and all landmarks,
// each carried along by its reference keyframe. Poses of similarities become rigid by dividing by
// their scale, which leaves every view as it is.
void write_loop_correction(const MapSnapshot& map, const MapGraph& solved, BundleResult& result);

// The result is of an earlier state of the map, which went on to `now`. Adds what it does not hold,
// carried along: keyframes by the nearest one above them in the spanning tree that moved, landmarks
// by their reference keyframe.
void carry_the_rest(const MapSnapshot& now, BundleResult& result);

}  // namespace hybrid_slam
