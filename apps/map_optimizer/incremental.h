#pragma once

#include <functional>
#include <stop_token>
#include <vector>

#include "apps/io/graphs/graph_file.h"
#include "backend/incremental/incremental_solver.h"
#include "backend/problem/solve_graph.h"

namespace hybrid_slam {

// One update of the incremental solver: a frame was added with all that ties it to earlier ones.
struct UpdateRecord {
  std::size_t poses = 0;  // so far
  // Of adding and solving, the newest pose included; not of the cost.
  double cpu_ms = 0;
  double wall_ms = 0;
  double cost = 0;  // half the sum of squares of all terms so far, without a loss
};

struct IncrementalRun {
  std::vector<UpdateRecord> updates;
  int steps = 0;         // of Gauss-Newton, over all updates
  bool stopped = false;  // on request, before the last frame
};

// Feeds a file's graph frame by frame, in its own order, into an IncrementalSolver, and moves the
// estimate of `graph`, a copy of the file's, to what that has at the end. Where a frame starts:
//   with odometry          at the previous estimate moved by it
//   with edges             where its edge to the previous frame leads, else its first to an earlier
//   else, or where fixed   where the file has it
// Landmarks start where the file has them; with odometry, where their first observation with a
// positive disparity puts them, seen from the estimate at that time. Cameras are known.
IncrementalRun run_incremental(const GraphFile& file, const IncrementalOptions& options,
                               const std::stop_token& stop,
                               const std::function<void(const UpdateRecord&)>& progress,
                               FactorGraph& graph);

// The same as other solvers sum up: `graph` has the estimate of the run.
GraphSummary summary_of(const IncrementalRun& run, const FactorGraph& graph);

}  // namespace hybrid_slam
