#pragma once

#include <utility>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// What a solved loop graph of this map says of it: the keyframes' new poses, and all landmarks,
// each carried along by its reference keyframe. Poses of similarities become rigid by dividing by
// their scale, which leaves every view as it is.
void write_loop_correction(const MapSnapshot& map, const MapGraph& solved, BundleResult& result);

// How a loop that was closed moved each keyframe: new_world_from_old_world there. Ascending; a
// keyframe that is not in it stayed where it was.
using LoopMove = std::vector<std::pair<KeyframeId, Rigid3d>>;

// What moving the map to these poses is for its keyframes.
LoopMove move_of(const MapSnapshot& before, const BundleResult& correction);

// The result is of the map before a loop was closed. Carries it over: keyframes move by the loop as
// they did in the map, and so do landmarks, by their reference keyframe. What the result says of
// the motions between neighbours stays.
void carry_over(const LoopMove& move, const MapSnapshot& now, BundleResult& result);

// The result is of an earlier state of the map, which went on to `now`. Adds what it does not hold,
// carried along: keyframes by the nearest one above them in the spanning tree that moved, landmarks
// by their reference keyframe.
void carry_the_rest(const MapSnapshot& now, BundleResult& result);

// The result says of `then` what moved. Adds what came into the map since: keyframes move as the
// one above them in the spanning tree does, landmarks as their reference keyframe.
void carry_newcomers(const MapSnapshot& then, const MapSnapshot& now, BundleResult& result);

}  // namespace hybrid_slam
