#pragma once

#include <cstdint>
#include <vector>

#include "backend/incremental/incremental_solver.h"
#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// Feeds the frames of a graph one by one to an IncrementalSolver, each with the edges and
// observations that join it to the frames before. The graph's estimate serves as a start: a frame
// comes in where its motion since the frame before leads from there, a point where it lies before
// the frame that completes it. A point waits with its observations until they determine it: one of
// three rows, or two. Frames keep their numbers, points do not.
class GraphFeed {
 public:
  GraphFeed(FactorGraph graph, const IncrementalOptions& options);

  bool done() const { return next_ == graph_.frames.size(); }
  // Adds the next frame and what comes with it.
  void add_next();
  // The same, and updates.
  UpdateSummary feed_next();

  IncrementalSolver& solver() { return solver_; }
  const IncrementalSolver& solver() const { return solver_; }

 private:
  void add_observation(std::uint32_t observation);

  static constexpr std::uint32_t kWaits = GraphFrame::kNoCamera;

  FactorGraph graph_;
  std::vector<std::vector<std::uint32_t>> edges_of_;         // by their later frame
  std::vector<std::vector<std::uint32_t>> observations_of_;  // by frame
  std::vector<std::vector<std::uint32_t>> waiting_;          // observations, by point
  std::vector<std::uint32_t> point_of_;                      // in the solver
  std::uint32_t next_ = 0;
  IncrementalSolver solver_;
};

// The cost of the optimum near a graph's estimate.
double batch_cost(FactorGraph graph);

// How far a solver's cost is above that optimum, relative to it or to what is no cost at all.
double excess(const IncrementalSolver& solver);

// Moves all but the fixed poses and all points away: standard deviations per axis in metres, and
// in radians, of a pose in its own frame.
void disturb(FactorGraph& graph, double translation, double rotation, double point,
             std::uint64_t seed);

}  // namespace hybrid_slam
