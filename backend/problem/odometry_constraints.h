#pragma once

#include <optional>
#include <span>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// The share of what the odometer followed into a keyframe that the map does not hold already: that
// is no landmark which both this keyframe and the one before it see. 0 without odometry.
double unshared(const MapSnapshot& map, const Keyframe& keyframe);

// The odometry of a keyframe as a term: a is the keyframe, b the one before it. Its information is
// the odometer's times `share`, so that the same measurements do not count twice: next to nothing
// is left where all of them are landmarks of both, everything where none is. None without odometry,
// and where nothing is left.
std::optional<PoseConstraint> odometry_constraint(const Keyframe& keyframe, double share);

// Those of these keyframes, as the map is now.
std::vector<PoseConstraint> odometry_constraints(const MapSnapshot& map,
                                                 std::span<const KeyframeId> keyframes);

}  // namespace hybrid_slam
