#pragma once

#include <cstddef>
#include <stop_token>

#include "backend/problem/solve_graph.h"

namespace hybrid_slam {

// What solve_graph does, with no more than `frames` of them varying at once, for graphs of cameras,
// frames, points, observations and edges: windows of frames that follow one another, each half of
// the one before, up and down the graph until that gains little, each with all points that its
// frames see, and with the other frames that see these held where they are. So memory and the time
// per window do not grow with the graph, and no window raises the cost. Cameras do not vary. An
// observation is an outlier if it was one in the last window that had it. Throws
// std::invalid_argument like solve_graph, and if the graph has terms of other kinds.
GraphSummary solve_windows(FactorGraph& graph, std::size_t frames, const ProblemOptions& options,
                           const std::stop_token& stop = {});

}  // namespace hybrid_slam
