#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/io/graphs/graph_file.h"
#include "apps/pose_graph/solve_pose_graph.h"
#include "backend/incremental/incremental_solver.h"

namespace hybrid_slam {

enum class ProblemKind {
  kFull,         // all that is not fixed
  kLoop,         // poses by their edges alone
  kLocal,        // the last frame, its neighbours and what they see
  kIncremental,  // all that is not fixed but the cameras, frame by frame
};

// Where the poses of a pose graph start from; kAuto: where the solution's cost is lowest or, with a
// loss, the start's.
enum class StartChoice { kAuto, kGiven, kTree, kRotations };

struct OptimizerOptions {
  ProblemKind problem = ProblemKind::kFull;
  std::optional<Loss> loss;  // none: what is usual for the input, see make_problem
  StartChoice start = StartChoice::kAuto;
  bool fix_intrinsics = false;
  int threads = 1;
  int iterations = 100;
  std::optional<std::string> frame;  // of kLocal, by name; none: the last one
};

// What is to be solved, and whose its rows are in the file's graph.
struct OptimizerProblem {
  FactorGraph graph;
  std::vector<std::uint32_t> frames, points;
  ProblemOptions options;
};

// The part of a file that the options ask for. Of a map that is what the backend would solve, with
// its rounds unless a loss is asked for; of other files the same frames and points, but more of
// them fixed, and for kLoop no observations, in one round. Throws InputError if the file has
// nothing for this kind of problem.
OptimizerProblem make_problem(const GraphFile& file, const OptimizerOptions& options,
                              const std::filesystem::path& input);

Loss loss_of(const OptimizerOptions& options);  // kNone unless asked for

// Moves the poses of a pose graph to the start that the options choose, and says which; leaves
// other graphs as they are.
PoseGraphStart choose_start(const OptimizerOptions& options, FactorGraph& graph);

PoseGraphOptions pose_graph_options(const OptimizerOptions& options);
IncrementalOptions incremental_options(const OptimizerOptions& options);

}  // namespace hybrid_slam
