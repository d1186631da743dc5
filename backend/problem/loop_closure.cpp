#include "backend/problem/loop_closure.h"

#include <cmath>
#include <utility>

#include "backend/problem/loop_correction.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/solve_graph.h"
#include "factors/transform_error.h"

namespace hybrid_slam {

namespace {

// The quantile of chi2 that lies `sigmas` above the middle, after Wilson and Hilferty.
double chi2_quantile(std::size_t degrees_of_freedom, double sigmas) {
  const double k = static_cast<double>(degrees_of_freedom);
  return k * std::pow(1 - 2 / (9 * k) + sigmas * std::sqrt(2 / (9 * k)), 3);
}

struct Solved {
  MapGraph made;
  double chi2 = 0;  // of all edges
  bool usable = false;
};

// From where the map is, or from the poses of `start`, which was made of the same map.
Solved solve(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
             const std::vector<LoopEnds>& closed, const LoopGraphOptions& options, Loss loss,
             const MapGraph* start = nullptr) {
  ProblemConfig config = make_loop_graph(map, loops, options, closed);
  config.options.loop_loss = loss;
  Solved solved;
  solved.made = make_graph(map, config);
  if (start != nullptr) {
    solved.made.graph.frames = start->graph.frames;
    solved.made.graph.similarities = start->graph.similarities;
  }
  const GraphSummary summary = solve_graph(solved.made.graph, config.options);
  solved.chi2 = 2 * summary.final_cost;
  solved.usable = summary.end == SolveEnd::kConverged || summary.end == SolveEnd::kIterationLimit;
  return solved;
}

double chi2_of(const FactorGraph& graph, const GraphSimilarityEdge& edge) {
  const Sim3d error = inverse(edge.a_from_b) * graph.similarities[edge.a].cam_from_world *
                      inverse(graph.similarities[edge.b].cam_from_world);
  const Vector7d residual = transform_error(error);
  return residual.dot(edge.information * residual);
}

// chi2 of each loop, in their order.
std::vector<double> loops_chi2(const FactorGraph& graph) {
  std::vector<double> values;
  for (const GraphEdge& edge : graph.edges) {
    if (edge.loop) values.push_back(chi2(graph, edge));
  }
  for (const GraphSimilarityEdge& edge : graph.similarity_edges) {
    if (edge.loop) values.push_back(chi2_of(graph, edge));
  }
  return values;
}

class Closer {
 public:
  Closer(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
         const std::vector<LoopEnds>& closed, const LoopClosureOptions& options)
      : map_(map), loops_(loops), closed_(closed), options_(options) {
    for (std::size_t i = 0; i < loops.size(); ++i) {
      if (map.find(loops[i].a) != nullptr && map.find(loops[i].b) != nullptr) there_.push_back(i);
    }
  }

  LoopClosure close() {
    const std::size_t newest = loops_.size() - 1;
    if (there_.empty() || there_.back() != newest) return {};
    LoopClosure alone = try_all({newest});
    if (!alone.taken.empty() || there_.size() == 1) return alone;
    const Solved robust = solve(map_, pick(there_), closed_, options_.graph, Loss::kCauchy);
    const std::vector<std::size_t> agreeing = agreeing_with_newest(robust);
    if (agreeing.size() < 2) return alone;
    LoopClosure together = try_all(agreeing, &robust.made);  // which begins nearly where it ends
    return together.taken.empty() ? alone : together;
  }

 private:
  std::vector<PoseConstraint> pick(const std::vector<std::size_t>& which) const {
    std::vector<PoseConstraint> picked;
    for (const std::size_t i : which) picked.push_back(loops_[i]);
    return picked;
  }

  LoopClosure try_all(const std::vector<std::size_t>& which,
                      const MapGraph* start = nullptr) const {
    const Solved solved = solve(map_, pick(which), closed_, options_.graph, Loss::kNone, start);
    LoopClosure closure;
    closure.chi2 = solved.chi2;
    const std::size_t per_loop = options_.graph.with_scale ? 7 : 6;
    if (!solved.usable || !(solved.chi2 <= chi2_quantile(per_loop * which.size(), options_.gate))) {
      return closure;
    }
    closure.taken = which;
    write_loop_correction(map_, solved.made, closure.correction);
    return closure;
  }

  // The loops that a robust optimum satisfies, if the newest is one of them.
  std::vector<std::size_t> agreeing_with_newest(const Solved& solved) const {
    const std::vector<double> values = loops_chi2(solved.made.graph);
    std::vector<std::size_t> agreeing;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i] <= options_.chi2_loop) agreeing.push_back(there_[i]);
    }
    if (agreeing.empty() || agreeing.back() != there_.back()) return {};
    return agreeing;
  }

  const MapSnapshot& map_;
  const std::vector<PoseConstraint>& loops_;
  const std::vector<LoopEnds>& closed_;
  const LoopClosureOptions& options_;
  std::vector<std::size_t> there_;  // loops whose keyframes are
};

}  // namespace

std::string LoopClosureOptions::validate() const {
  if (!(gate > 0) || !(chi2_loop > 0)) return "loop closure: gate and chi2_loop must be positive";
  return graph.problem.validate();
}

LoopClosure close_loop(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
                       const std::vector<LoopEnds>& closed, const LoopClosureOptions& options) {
  return Closer(map, loops, closed, options).close();
}

}  // namespace hybrid_slam
