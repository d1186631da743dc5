#pragma once

#include <vector>

#include "backend/problem/loop_graph.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {

// A map of a circle flown once, each place known once: neighbours share landmarks, and so do the
// two ends.
FilledMap circle_map(int keyframes = 24);

struct MapTruth {
  std::vector<Rigid3d> cam_from_world;  // by keyframe
  std::vector<Eigen::Vector3d> points;  // by landmark, in the order of their ids
};

// The map as it is now.
MapTruth truth_of(const MapSnapshot& map);

// Every step ends `drift` further in the frame of the camera, and is `growth` times as large as it
// should be, compared with the one before. Landmarks keep their place before their reference.
void let_drift(Map& map, const MapTruth& truth, const Vector6d& drift, double growth);

// Some millimetres and tenths of a degree.
Vector6d small_drift();

double worst_position_error(const MapSnapshot& map, const MapTruth& truth);
double worst_point_error(const MapSnapshot& map, const MapTruth& truth);

// What a loop between two keyframes would measure.
PoseConstraint measured(const MapTruth& truth, std::uint32_t a, std::uint32_t b);

// Only neighbours along the way remember each other, so that the ends are free.
LoopGraphOptions chain_options();

}  // namespace hybrid_slam
