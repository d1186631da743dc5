#include "backend/problem/solve_bundle.h"

#include "backend/problem/loop_correction.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/solve_graph.h"
#include "backend/problem/solve_windows.h"

namespace hybrid_slam {

namespace {

BundleSummary summary_of(const GraphSummary& solved, std::size_t observations) {
  BundleSummary summary;
  summary.end = solved.end;
  summary.text = solved.text;
  summary.initial_cost = solved.kept_initial_cost;
  summary.final_cost = solved.kept_final_cost;
  summary.iterations = solved.iterations;
  summary.observations = static_cast<int>(observations - solved.outliers.size());
  summary.seconds = solved.seconds;
  return summary;
}

void write_estimate(const MapGraph& made, BundleResult& result) {
  const FactorGraph& graph = made.graph;
  std::vector<char> frame_used(made.frames.size(), 0);
  std::vector<char> point_used(made.points.size(), 0);
  for (const GraphObservation& observation : graph.observations) {
    frame_used[observation.frame] = point_used[observation.point] = 1;
  }
  for (const GraphEdge& edge : graph.edges) frame_used[edge.a] = frame_used[edge.b] = 1;
  for (std::size_t i = 0; i < graph.frames.size(); ++i) {
    if (frame_used[i] != 0 && !graph.frames[i].fixed) {
      result.cam_from_world.emplace_back(made.frames[i], graph.frames[i].cam_from_world);
    }
  }
  for (std::size_t i = 0; i < graph.points.size(); ++i) {
    if (point_used[i] != 0 && !graph.points[i].fixed) {
      result.point_in_world.emplace_back(made.points[i], graph.points[i].in_world);
    }
  }
  for (std::uint32_t i = 0; i < graph.cameras.size(); ++i) {
    if (graph.cameras[i].refined != 0) {
      result.cameras.emplace_back(CameraId(i), graph.cameras[i].camera);
    }
  }
}

}  // namespace

BundleResult solve_bundle(const MapSnapshot& map, const ProblemConfig& config,
                          const std::stop_token& stop) {
  MapGraph made = make_graph(map, config);
  const GraphSummary solved = config.window > 0
                                  ? solve_windows(made.graph, config.window, config.options, stop)
                                  : solve_graph(made.graph, config.options, stop);
  BundleResult result;
  result.summary = summary_of(solved, made.observations.size());
  if (solved.end == SolveEnd::kFailed || solved.end == SolveEnd::kEmpty) {
    result.summary.observations = 0;
    return result;
  }
  if (solved.end == SolveEnd::kConverged || solved.end == SolveEnd::kIterationLimit) {
    for (const std::uint32_t i : solved.outliers) result.outliers.push_back(made.observations[i]);
  }
  if (made.graph.observations.empty()) {
    write_loop_correction(map, made, result);
  } else {
    write_estimate(made, result);
  }
  result.summary.variable_poses = static_cast<int>(result.cam_from_world.size());
  result.summary.variable_landmarks = static_cast<int>(result.point_in_world.size());
  result.summary.outliers = static_cast<int>(result.outliers.size());
  return result;
}

}  // namespace hybrid_slam
