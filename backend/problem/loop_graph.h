#pragma once

#include <vector>

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// One round, in which false loops lose their say.
inline ProblemOptions loop_graph_problem() {
  ProblemOptions problem;
  problem.rounds = {{20, Loss::kNone, 1e-8}};
  problem.loop_loss = Loss::kCauchy;
  return problem;
}

struct LoopGraphOptions {
  int min_shared_landmarks = 100;  // of a covisibility edge to be kept
  bool with_scale = false;         // Sim3: where the scale may have drifted
  // Weights of all edges: standard deviations of a motion between neighbours.
  double translation_sigma = 0.05;  // [m]
  double rotation_sigma = 0.01;     // [rad]
  double scale_sigma = 0.01;        // of the logarithm
  ProblemOptions problem = loop_graph_problem();
};

// The essential graph of a map (ORB-SLAM2, section V-C): its spanning tree and its strong
// covisibility edges, which hold the relative poses that the map has now, and `loops`, measured.
// Loops need not come with weights of their own: an information that is the identity is replaced by
// the options' weights. Every keyframe varies but the origin.
ProblemConfig make_loop_graph(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
                              const LoopGraphOptions& options);

}  // namespace hybrid_slam
