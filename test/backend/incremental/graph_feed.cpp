#include "test/backend/incremental/graph_feed.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "test/support/random.h"

namespace hybrid_slam {

GraphFeed::GraphFeed(FactorGraph graph, const IncrementalOptions& options)
    : graph_(std::move(graph)),
      edges_of_(graph_.frames.size()),
      observations_of_(graph_.frames.size()),
      waiting_(graph_.points.size()),
      point_of_(graph_.points.size(), kWaits),
      solver_(options) {
  if (const std::string wrong = graph_.validate(); !wrong.empty()) throw std::logic_error(wrong);
  for (const GraphCamera& camera : graph_.cameras) solver_.add_camera(camera.camera);
  for (std::uint32_t i = 0; i < graph_.edges.size(); ++i) {
    edges_of_[std::max(graph_.edges[i].a, graph_.edges[i].b)].push_back(i);
  }
  for (std::uint32_t i = 0; i < graph_.observations.size(); ++i) {
    observations_of_[graph_.observations[i].frame].push_back(i);
  }
}

void GraphFeed::add_next() {
  GraphFrame frame = graph_.frames[next_];
  if (!frame.fixed && next_ > 0) {
    const Rigid3d current_from_previous =
        frame.cam_from_world * inverse(graph_.frames[next_ - 1].cam_from_world);
    frame.cam_from_world = current_from_previous * solver_.pose(next_ - 1);
  }
  solver_.add_pose(frame);
  for (const std::uint32_t edge : edges_of_[next_]) solver_.add_edge(graph_.edges[edge]);
  for (const std::uint32_t observation : observations_of_[next_]) add_observation(observation);
  ++next_;
}

void GraphFeed::add_observation(std::uint32_t index) {
  const GraphObservation& observation = graph_.observations[index];
  std::uint32_t& point = point_of_[observation.point];
  auto& waiting = waiting_[observation.point];
  waiting.push_back(index);
  if (point == kWaits) {
    const GraphFrame& frame = graph_.frames[observation.frame];
    const bool three_rows = baseline(graph_.cameras[frame.camera].camera) > 0 &&
                            !std::isnan(observation.measurement[2]);
    if (!three_rows && waiting.size() < 2) return;
    point = solver_.add_point(inverse(solver_.pose(observation.frame)) *
                              (frame.cam_from_world * graph_.points[observation.point].in_world));
  }
  for (const std::uint32_t i : waiting) {
    GraphObservation known = graph_.observations[i];
    known.point = point;
    solver_.add_observation(known);
  }
  waiting.clear();
}

UpdateSummary GraphFeed::feed_next() {
  add_next();
  return solver_.update();
}

double batch_cost(FactorGraph graph) {
  ProblemOptions options;
  options.rounds = {{50, Loss::kNone, 1e-9}};
  const GraphSummary summary = solve_graph(graph, options);
  if (!summary.unprojectable.empty()) throw std::logic_error("points that do not project");
  return cost(graph);
}

double excess(const IncrementalSolver& solver) {
  constexpr double kNoCost = 1e-6;  // per term
  const FactorGraph graph = solver.graph();
  const double best = batch_cost(graph);
  const auto terms = static_cast<double>(graph.observations.size() + graph.edges.size());
  return (cost(graph) - best) / std::max(best, kNoCost * terms);
}

void disturb(FactorGraph& graph, double translation, double rotation, double point,
             std::uint64_t seed) {
  Random random(seed);
  for (GraphFrame& frame : graph.frames) {
    if (frame.fixed) continue;
    Vector6d error;
    error << random.gaussian3(translation), random.gaussian3(rotation);
    frame.cam_from_world = se3_exp(error) * frame.cam_from_world;
  }
  for (GraphPoint& p : graph.points) p.in_world += random.gaussian3(point);
}

}  // namespace hybrid_slam
