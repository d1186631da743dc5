#include "apps/map_optimizer/problem.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "backend/problem/local_bundle.h"

namespace hybrid_slam {

namespace {

// The cost is followed down to here: 1e-6 leaves some pose graphs 0.1 % above their optimum.
constexpr double kFunctionTolerance = 1e-8;

// Nearly Gauss-Newton from the first step, which the trust region shrinks where that leads nowhere.
// From the default of 1e4, damping along the long survey's weak bends takes 21 iterations, not 4.
constexpr double kTrustRegion = 1e8;

std::vector<std::vector<std::uint32_t>> points_by_frame(const FactorGraph& graph) {
  std::vector<std::vector<std::uint32_t>> points(graph.frames.size());
  for (const GraphObservation& o : graph.observations) points[o.frame].push_back(o.point);
  return points;
}

// The last frame and those that share most points with it.
std::vector<std::size_t> local_frames(const FactorGraph& graph,
                                      const std::vector<std::vector<std::uint32_t>>& points) {
  const LocalBundleOptions window;
  const std::size_t newest = graph.frames.size() - 1;
  std::vector<char> seen(graph.points.size());
  for (const std::uint32_t point : points[newest]) seen[point] = 1;
  std::vector<std::size_t> frames(newest);
  std::iota(frames.begin(), frames.end(), 0);
  std::vector<std::ptrdiff_t> shared(newest);
  for (const std::size_t i : frames) {
    shared[i] = std::count_if(points[i].begin(), points[i].end(),
                              [&](std::uint32_t point) { return seen[point] != 0; });
  }
  std::erase_if(frames, [&](std::size_t i) { return shared[i] < window.min_shared_landmarks; });
  std::stable_sort(frames.begin(), frames.end(),
                   [&](std::size_t a, std::size_t b) { return shared[a] > shared[b]; });
  frames.resize(std::min(frames.size(), window.max_neighbours));
  frames.push_back(newest);
  return frames;
}

// Fixes all but the window, and the cameras: what so few frames say of them is little.
void restrict_to_window(FactorGraph& graph) {
  const auto points = points_by_frame(graph);
  std::vector<char> frame_varies(graph.frames.size());
  std::vector<char> point_varies(graph.points.size());
  for (const std::size_t frame : local_frames(graph, points)) {
    frame_varies[frame] = 1;
    for (const std::uint32_t point : points[frame]) point_varies[point] = 1;
  }
  for (std::size_t i = 0; i < graph.frames.size(); ++i) {
    graph.frames[i].fixed |= frame_varies[i] == 0;
  }
  for (std::size_t i = 0; i < graph.points.size(); ++i) {
    graph.points[i].fixed |= point_varies[i] == 0;
  }
  for (GraphCamera& camera : graph.cameras) camera.refined = 0;
}

std::vector<PoseGraphStart> starts_of(StartChoice choice) {
  switch (choice) {
    case StartChoice::kGiven:
      return {PoseGraphStart::kGiven};
    case StartChoice::kTree:
      return {PoseGraphStart::kTree};
    case StartChoice::kRotations:
      return {PoseGraphStart::kRotations};
    default:
      return all_pose_graph_starts();
  }
}

}  // namespace

FactorGraph make_problem(const FactorGraph& graph, const OptimizerOptions& options,
                         const std::filesystem::path& input) {
  FactorGraph problem = graph;
  if (options.fix_intrinsics) {
    for (GraphCamera& camera : problem.cameras) camera.refined = 0;
  }
  if (options.problem == ProblemKind::kLoop) {
    if (graph.edges.empty()) throw InputError(input.string() + ": holds no edges between poses");
    problem.observations.clear();
  } else if (options.problem == ProblemKind::kLocal) {
    if (graph.observations.empty()) throw InputError(input.string() + ": holds no observations");
    restrict_to_window(problem);
  }
  return problem;
}

PoseGraphStart choose_start(const OptimizerOptions& options, FactorGraph& graph) {
  if (!is_pose_graph(graph)) return PoseGraphStart::kGiven;
  const std::vector<PoseGraphStart> starts = starts_of(options.start);
  const PoseGraphStructure structure(graph);
  FactorGraph best = graph;
  PoseGraphStart chosen = PoseGraphStart::kGiven;
  double lowest = std::numeric_limits<double>::infinity();
  for (const PoseGraphStart start : starts) {
    FactorGraph candidate = graph;
    const std::vector<Rigid3d> poses = start_poses(graph, structure, start);
    for (std::size_t i = 0; i < poses.size(); ++i) candidate.frames[i].cam_from_world = poses[i];
    const double candidate_cost = cost(candidate);
    if (candidate_cost < lowest || starts.size() == 1) {
      lowest = candidate_cost;
      chosen = start;
      best = std::move(candidate);
    }
  }
  graph = std::move(best);
  return chosen;
}

PoseGraphOptions pose_graph_options(const OptimizerOptions& options) {
  PoseGraphOptions solver;
  solver.starts = starts_of(options.start);
  solver.iterations = options.iterations;
  return solver;
}

ProblemOptions solver_options(const OptimizerOptions& options) {
  ProblemOptions solver;
  solver.rounds = {{options.iterations, options.loss, kFunctionTolerance}};
  solver.loop_loss = options.loss;
  solver.trust_region = kTrustRegion;
  solver.threads = options.threads;
  return solver;
}

}  // namespace hybrid_slam
