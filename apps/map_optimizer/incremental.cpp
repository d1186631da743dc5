#include "apps/map_optimizer/incremental.h"

#include <ceres/cost_function.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>

#include "backend/problem/problem_builder.h"

namespace hybrid_slam {

namespace {

constexpr std::uint32_t kAbsent = std::numeric_limits<std::uint32_t>::max();

class Feed {
 public:
  Feed(const GraphFile& file, const IncrementalOptions& options)
      : file_(file),
        graph_(file.graph),
        solver_(options),
        observations_(graph_.frames.size()),
        edges_(graph_.frames.size()),
        point_in_solver_(graph_.points.size(), kAbsent),
        waiting_(graph_.points.size()) {
    for (const GraphCamera& camera : graph_.cameras) solver_.add_camera(camera.camera);
    for (const GraphObservation& o : graph_.observations) observations_[o.frame].push_back(&o);
    for (const GraphEdge& e : graph_.edges) edges_[std::max(e.a, e.b)].push_back(&e);
  }

  // The next frame, with its observations and its edges to earlier ones. Returns the steps.
  int add_frame() {
    const auto i = static_cast<std::uint32_t>(solver_.pose_count());
    GraphFrame frame = graph_.frames[i];
    if (!frame.fixed) frame.cam_from_world = start_of(i);
    solver_.add_pose(frame);
    for (const GraphObservation* o : observations_[i]) add_observation(*o, frame.cam_from_world);
    for (const GraphEdge* edge : edges_[i]) solver_.add_edge(*edge);
    const int steps = solver_.update().steps;
    newest_ = solver_.pose(i);
    return steps;
  }

  double cost() const { return solver_.cost(); }

  void write_estimate(FactorGraph& graph) const {
    for (std::uint32_t i = 0; i < solver_.pose_count(); ++i) {
      graph.frames[i].cam_from_world = solver_.pose(i);
    }
    for (std::size_t i = 0; i < point_in_solver_.size(); ++i) {
      if (point_in_solver_[i] != kAbsent) {
        graph.points[i].in_world = solver_.point(point_in_solver_[i]);
      }
    }
  }

 private:
  bool has_odometry() const { return !file_.previous_from_current.empty(); }

  Rigid3d start_of(std::uint32_t i) const {
    if (i > 0 && has_odometry()) return inverse(file_.previous_from_current[i]) * newest_;
    if (edges_[i].empty()) return graph_.frames[i].cam_from_world;
    const auto to_previous = std::find_if(edges_[i].begin(), edges_[i].end(), [&](const auto* e) {
      return std::min(e->a, e->b) + 1 == i;
    });
    const GraphEdge& edge = **(to_previous == edges_[i].end() ? edges_[i].begin() : to_previous);
    return edge.b == i ? inverse(edge.a_from_b) * solver_.pose(edge.a)
                       : edge.a_from_b * solver_.pose(edge.b);
  }

  void add_observation(const GraphObservation& observation, const Rigid3d& cam_from_world) {
    std::uint32_t& index = point_in_solver_[observation.point];
    std::vector<const GraphObservation*>& waiting = waiting_[observation.point];
    waiting.push_back(&observation);
    if (index == kAbsent) {
      const auto start = start_of(observation, cam_from_world);
      if (!start) return;
      index = solver_.add_point(*start);
    }
    for (const GraphObservation* o : waiting) {
      GraphObservation added = *o;
      added.point = index;
      solver_.add_observation(added);
    }
    waiting.clear();
  }

  std::optional<Eigen::Vector3d> start_of(const GraphObservation& observation,
                                          const Rigid3d& cam_from_world) const {
    if (!has_odometry()) return graph_.points[observation.point].in_world;
    const Camera& camera = graph_.cameras[graph_.frames[observation.frame].camera].camera;
    const auto in_cam = triangulate_stereo(camera, observation.measurement);
    if (!in_cam) return std::nullopt;
    return inverse(cam_from_world) * *in_cam;
  }

  const GraphFile& file_;
  const FactorGraph& graph_;
  IncrementalSolver solver_;
  Rigid3d newest_;
  std::vector<std::vector<const GraphObservation*>> observations_;  // by frame
  std::vector<std::vector<const GraphEdge*>> edges_;                // by their later frame
  std::vector<std::uint32_t> point_in_solver_;
  std::vector<std::vector<const GraphObservation*>> waiting_;  // by point, until it has a place
};

}  // namespace

IncrementalRun run_incremental(const GraphFile& file, const IncrementalOptions& options,
                               const std::stop_token& stop,
                               const std::function<void(const UpdateRecord&)>& progress,
                               FactorGraph& graph) {
  Feed feed(file, options);
  IncrementalRun run;
  for (std::size_t i = 0; i < file.graph.frames.size() && !run.stopped; ++i) {
    const auto wall = std::chrono::steady_clock::now();
    const std::clock_t cpu = std::clock();
    run.steps += feed.add_frame();
    UpdateRecord record;
    record.cpu_ms = 1e3 * static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - wall;
    record.wall_ms = took.count();
    record.poses = i + 1;
    record.cost = feed.cost();
    run.updates.push_back(record);
    if (progress) progress(record);
    run.stopped = stop.stop_requested() && record.poses < file.graph.frames.size();
  }
  feed.write_estimate(graph);
  return run;
}

GraphSummary summary_of(const IncrementalRun& run, const FactorGraph& graph) {
  GraphSummary summary;
  summary.end = run.stopped ? SolveEnd::kStopped : SolveEnd::kConverged;
  summary.text =
      fmt::format("{} of {} frames were taken in", run.updates.size(), graph.frames.size());
  summary.iterations = run.steps;
  const ProblemOptions thresholds;
  const std::vector<double> chi2 = observations_chi2(graph);
  for (std::uint32_t i = 0; i < chi2.size(); ++i) {
    if (!std::isfinite(chi2[i])) summary.unprojectable.push_back(i);
    const bool stereo = residual_count(graph, graph.observations[i]) == 3;
    if (!(chi2[i] <= (stereo ? thresholds.chi2_stereo : thresholds.chi2_mono))) {
      summary.outliers.push_back(i);
    }
  }
  return summary;
}

}  // namespace hybrid_slam
