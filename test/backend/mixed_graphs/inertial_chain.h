#pragma once

#include <vector>

#include "backend/incremental/incremental_solver.h"
#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// A way of poses with a 9-d block each (velocity in the world, two biases), an inertial factor from
// each to the next, and odometry between them. The first pose is held by a prior factor and its
// block by another; measurements have noise, starts are off. Factors and edges belong to their
// later frame.
struct InertialChain {
  FactorGraph graph;  // blocks[i] belongs to frames[i]
  std::vector<Rigid3d> truth;
  std::vector<Eigen::VectorXd> true_blocks;
};

struct InertialChainOptions {
  int poses = 60;
  double laps = 1.2;          // of a circle of 5 m radius
  int ranges = 0;             // beacons, as blocks of three behind those of the frames
  int landmarks = 0;          // per pose, ahead of it, which a stereo pair sees on every lap
  bool world_vectors = true;  // whether velocities turn with their poses
  bool odometry = true;
  bool loops = true;   // edges to a lap before
  bool anchor = true;  // a prior holds the first pose
  double noise = 1;    // of the measurements, in parts of what they are weighed by
  // Whether all else has the noise that it is weighed by, too: priors, places, the biases' walk.
  bool consistent = false;
  std::uint64_t seed = 1;
};

InertialChain inertial_chain(const InertialChainOptions& options);

// Feeds a graph's frames one by one, with their blocks, edges and factors; other blocks come first.
// Starts as GraphFeed has them.
class MixedFeed {
 public:
  MixedFeed(FactorGraph graph, const IncrementalOptions& options);
  bool done() const { return next_ == graph_.frames.size(); }
  std::uint32_t count() const { return next_; }
  void add_next();
  UpdateSummary feed_next();
  IncrementalSolver& solver() { return solver_; }

 private:
  std::uint32_t known_point(std::uint32_t point);

  FactorGraph graph_;
  std::vector<std::vector<std::uint32_t>> edges_of_;
  std::vector<std::vector<std::uint32_t>> factors_of_;
  std::vector<std::vector<std::uint32_t>> observations_of_;
  std::vector<std::vector<std::uint32_t>> blocks_of_;  // by the frame that they ride with
  std::vector<std::uint32_t> block_in_solver_;
  std::vector<std::uint32_t> point_in_solver_;
  std::uint32_t next_ = 0;
  IncrementalSolver solver_;
};

}  // namespace hybrid_slam
