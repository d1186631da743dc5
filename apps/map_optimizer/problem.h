#pragma once

#include <functional>
#include <stop_token>

#include "apps/io/graphs/graph_file.h"
#include "backend/problem/solve_pose_graph.h"

namespace hybrid_slam {

enum class ProblemKind {
  kFull,   // all that is not fixed
  kLoop,   // poses by their edges alone
  kLocal,  // the last frame, its neighbours and what they see
};

// Where the poses of a pose graph start from; kAuto: where the solution's cost is lowest or, with a
// loss, the start's.
enum class StartChoice { kAuto, kGiven, kTree, kRotations };

struct OptimizerOptions {
  ProblemKind problem = ProblemKind::kFull;
  Loss loss = Loss::kNone;
  StartChoice start = StartChoice::kAuto;
  bool fix_intrinsics = false;
  int threads = 1;
  int iterations = 100;
};

// The part of a file's graph that the options ask for: same frames and points, but more of them
// fixed, and for kLoop no observations. Throws InputError if the file has nothing for this kind of
// problem.
FactorGraph make_problem(const FactorGraph& graph, const OptimizerOptions& options,
                         const std::filesystem::path& input);

// Moves the poses of a pose graph to the start that the options choose, and says which; leaves
// other graphs as they are.
PoseGraphStart choose_start(const OptimizerOptions& options, FactorGraph& graph);

PoseGraphOptions pose_graph_options(const OptimizerOptions& options);
ProblemOptions solver_options(const OptimizerOptions& options);

}  // namespace hybrid_slam
