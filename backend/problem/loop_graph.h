#pragma once

#include <utility>
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
  // Standard deviations of a motion between two keyframes. Drift is a share of the way; the edges
  // run side by side, so each is given more than its part.
  double translation_share = 0.05;       // of the distance between the two
  double min_translation_sigma = 0.005;  // [m]
  double rotation_sigma = 0.01;          // [rad]
  double scale_sigma = 0.01;             // of the logarithm
  double metric_scale_sigma = 1e-4;      // the same between two stereo pairs, which cannot drift
  ProblemOptions problem = loop_graph_problem();
};

// The weight of a motion between two keyframes (translation, rotation, log scale).
Matrix7d motion_information(const MapSnapshot& map, KeyframeId a, KeyframeId b,
                            const Sim3d& a_from_b, const LoopGraphOptions& options);

// Two keyframes that a loop joined earlier.
using LoopEnds = std::pair<KeyframeId, KeyframeId>;

// The essential graph of a map (ORB-SLAM2, section V-C): its spanning tree, its strong covisibility
// edges, the loops closed before and the pairs that odometry joins, which hold the relative poses
// that the map has now, loosely between components, and `loops`, measured. Loops need not come with
// weights of their own: an information that is the identity is replaced by motion_information().
// Every keyframe varies but the origin and, where there are loops, what is older than all their
// ends and joined by no edge to what is newer: it does not bend. Loops come last among the
// constraints, in their order.
ProblemConfig make_loop_graph(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
                              const LoopGraphOptions& options,
                              const std::vector<LoopEnds>& closed = {});

}  // namespace hybrid_slam
