#include "apps/map_optimizer/problem.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include <ceres/cost_function.h>

#include "backend/problem/full_bundle.h"
#include "backend/problem/local_bundle.h"
#include "backend/problem/loop_graph.h"
#include "backend/problem/map_graph.h"

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

// A frame and those that share most points with it.
std::vector<std::size_t> local_frames(const FactorGraph& graph, std::size_t around,
                                      const std::vector<std::vector<std::uint32_t>>& points) {
  const LocalBundleOptions window;
  std::vector<char> seen(graph.points.size());
  for (const std::uint32_t point : points[around]) seen[point] = 1;
  std::vector<std::size_t> frames(graph.frames.size());
  std::iota(frames.begin(), frames.end(), 0);
  std::vector<std::ptrdiff_t> shared(frames.size());
  for (const std::size_t i : frames) {
    shared[i] = std::count_if(points[i].begin(), points[i].end(),
                              [&](std::uint32_t point) { return seen[point] != 0; });
  }
  std::erase_if(frames, [&](std::size_t i) {
    return i == around || shared[i] < window.min_shared_landmarks;
  });
  std::stable_sort(frames.begin(), frames.end(),
                   [&](std::size_t a, std::size_t b) { return shared[a] > shared[b]; });
  frames.resize(std::min(frames.size(), window.max_neighbours));
  frames.push_back(around);
  return frames;
}

// Fixes all but the window, and the cameras: what so few frames say of them is little.
void restrict_to_window(FactorGraph& graph, std::size_t around) {
  const auto points = points_by_frame(graph);
  std::vector<char> frame_varies(graph.frames.size());
  std::vector<char> point_varies(graph.points.size());
  for (const std::size_t frame : local_frames(graph, around, points)) {
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

// The frame of kLocal.
std::size_t find_frame(const GraphFile& file, const OptimizerOptions& options,
                       const std::filesystem::path& input) {
  if (!options.frame) return file.graph.frames.size() - 1;
  const auto found = std::find(file.frame_names.begin(), file.frame_names.end(), *options.frame);
  if (found == file.frame_names.end()) {
    throw InputError(input.string() + ": has no frame \"" + *options.frame + "\"");
  }
  return static_cast<std::size_t>(found - file.frame_names.begin());
}

// The bundles and the loop graph of the backend.
ProblemConfig map_config(const GraphFile& file, const OptimizerOptions& options,
                         const std::filesystem::path& input) {
  const MapSnapshot& map = *file.map;
  if (options.problem == ProblemKind::kLoop) return make_loop_graph(map, {}, {});
  if (options.problem == ProblemKind::kFull) return make_full_bundle(map, {});
  return make_local_bundle(map, map.keyframe_ids()[find_frame(file, options, input)], {});
}

template <typename Id>
std::vector<std::uint32_t> places_of(const std::vector<Id>& ids, const std::vector<Id>& all) {
  std::vector<std::uint32_t> places;
  for (const Id id : ids) {
    places.push_back(
        static_cast<std::uint32_t>(std::lower_bound(all.begin(), all.end(), id) - all.begin()));
  }
  return places;
}

OptimizerProblem make_map_problem(const GraphFile& file, const OptimizerOptions& options,
                                  const std::filesystem::path& input) {
  const ProblemConfig config = map_config(file, options, input);
  MapGraph made = make_graph(*file.map, config);
  OptimizerProblem problem;
  problem.graph = std::move(made.graph);
  problem.frames = places_of(made.frames, file.map->keyframe_ids());
  problem.points = places_of(made.points, file.map->landmark_ids());
  problem.options = config.options;
  problem.options.rounds.back().iterations = options.iterations;
  return problem;
}

void restrict(const GraphFile& file, const OptimizerOptions& options,
              const std::filesystem::path& input, FactorGraph& problem) {
  if (options.fix_intrinsics) {
    for (GraphCamera& camera : problem.cameras) camera.refined = 0;
    for (GraphBlock& block : problem.blocks) block.fixed = true;
  }
  const ProblemOptions thresholds;
  for (GraphFactor& factor : problem.factors) {
    factor.loss = loss_of(options);
    factor.threshold =
        factor.function->num_residuals() == 3 ? thresholds.chi2_stereo : thresholds.chi2_mono;
  }
  if (options.problem == ProblemKind::kLoop) {
    if (problem.edges.empty()) throw InputError(input.string() + ": holds no edges between poses");
    problem.observations.clear();
  } else if (options.problem == ProblemKind::kLocal) {
    if (problem.observations.empty()) throw InputError(input.string() + ": holds no observations");
    restrict_to_window(problem, find_frame(file, options, input));
  }
}

std::vector<std::uint32_t> count_up(std::size_t size) {
  std::vector<std::uint32_t> values(size);
  std::iota(values.begin(), values.end(), 0);
  return values;
}

}  // namespace

Loss loss_of(const OptimizerOptions& options) { return options.loss.value_or(Loss::kNone); }

OptimizerProblem make_problem(const GraphFile& file, const OptimizerOptions& options,
                              const std::filesystem::path& input) {
  const bool bundles_of_map = file.map != nullptr && !file.graph.frames.empty() &&
                              options.problem != ProblemKind::kIncremental;
  if (options.problem != ProblemKind::kFull && !file.graph.factors.empty()) {
    throw InputError(input.string() +
                     ": holds landmarks or cameras that only --problem full can take");
  }
  OptimizerProblem problem;
  if (bundles_of_map) {
    problem = make_map_problem(file, options, input);
  } else {
    problem.graph = file.graph;
    problem.frames = count_up(file.graph.frames.size());
    problem.points = count_up(file.graph.points.size());
    restrict(file, options, input, problem.graph);
  }
  if (!bundles_of_map || options.loss) {
    problem.options.rounds = {{options.iterations, loss_of(options), kFunctionTolerance}};
    problem.options.loop_loss = loss_of(options);
    problem.options.trust_region = kTrustRegion;
  }
  problem.options.threads = options.threads;
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

IncrementalOptions incremental_options(const OptimizerOptions& options) {
  IncrementalOptions solver;
  solver.loss = solver.loop_loss = loss_of(options);
  return solver;
}

}  // namespace hybrid_slam
