#pragma once

#include <string>
#include <vector>

#include "apps/pose_graph/pose_graph_start.h"
#include "backend/problem/solve_graph.h"

namespace hybrid_slam {

struct PoseGraphOptions {
  // Which to try; of all solutions the one with the lowest cost is kept. Not empty.
  std::vector<PoseGraphStart> starts = all_pose_graph_starts();
  // A solution whose squared whitened residuals sum to at most this often their expected value
  // (6 per edge less 6 per pose that is sought) explains the measurements: no other start is tried.
  double enough = 1.5;
  int iterations = 50;
  double function_tolerance = 1e-8;  // ends below this relative decrease of the cost

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

struct PoseGraphAttempt {
  PoseGraphStart start = PoseGraphStart::kGiven;
  double start_cost = 0;  // half the sum of squares
  double cost = 0;
};

struct PoseGraphSummary {
  GraphSummary summary;                           // initial_cost: of the given poses
  PoseGraphStart start = PoseGraphStart::kGiven;  // where the solution came from
  std::vector<PoseGraphAttempt> attempts;         // in the order in which they were made
};

// Whether solve_pose_graph can be used: all terms are edges between frames.
bool is_pose_graph(const FactorGraph& graph);

// Solves a pose graph from several starts, the one with the lowest cost first: Gauss-Newton
// (pose_graph_descent.h) and, where it does not get there, solve_graph. Moves the estimate to the
// best solution, never to one worse than the given poses. A connected part without a fixed frame is
// held by its first one. No robust loss: whoever distrusts the loops starts where the odometry is,
// with solve_graph. Throws std::invalid_argument if the graph or the options are not valid, or if
// it is no pose graph.
PoseGraphSummary solve_pose_graph(FactorGraph& graph, const PoseGraphOptions& options,
                                  const std::stop_token& stop = {},
                                  const std::function<void(const IterationReport&)>& progress = {});

}  // namespace hybrid_slam
