#pragma once

#include <vector>

#include "apps/pose_graph/pose_graph_structure.h"
#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// Where the poses of a graph start from. A solver goes downhill: on a graph with large loops the
// start decides which valley it ends in, and no one start is the best on every graph.
enum class PoseGraphStart {
  kGiven,     // as the graph has them
  kTree,      // edges chained along the most certain paths
  kRotations  // rotations of all edges at once, then positions: chordal relaxation
};

const char* name_of(PoseGraphStart start);
std::vector<PoseGraphStart> all_pose_graph_starts();

// Weights of an edge under isotropic noise closest to its information, as in SE-Sync (Rosen et al.,
// IJRR 2019): F = sum rotation |R_b - R_a R_ab|_F^2 + translation |t_b - t_a - R_a t_ab|^2, with R,
// t of world_from_frame. rotation = 3 / (2 tr(inverse of the information's rotation block)),
// translation = 3 / tr(inverse of its translation block); 0 where a block is singular.
struct IsotropicWeights {
  double rotation = 0;
  double translation = 0;
};
IsotropicWeights isotropic_weights(const Matrix6d& information);

// F above over all edges of the graph.
double isotropic_objective(const FactorGraph& graph);

// cam_from_world of every frame, from the edges alone and the poses of the frames that the
// structure names as known; frames without edges are among these.
//
// kTree: the tree of the shortest paths from the known frames, an edge's length being the variance
// of its rotation.
// kRotations: minimises the rotation part of F over all 3x3 matrices, a linear problem, takes the
// nearest rotations, and minimises the translation part (Carlone et al., ICRA 2015, section III-B).
// Exact where the measurements are. Falls back to kTree if the linear problem cannot be solved.
//
// Requires a valid graph, and its structure.
std::vector<Rigid3d> start_poses(const FactorGraph& graph, const PoseGraphStructure& structure,
                                 PoseGraphStart start);
std::vector<Rigid3d> start_poses(const FactorGraph& graph, PoseGraphStart start);

}  // namespace hybrid_slam
