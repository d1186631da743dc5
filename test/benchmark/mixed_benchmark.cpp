// Incremental smoothing of mixed graphs of 2,000 steps: poses with blocks of velocity and bias
// against the same poses without them, and landmarks that all see one calibration. CPU time per
// update; how often the calibration reached everything; the covariance of the newest pose.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <vector>

#include <ceres/manifold.h>

#include "backend/problem/solve_graph.h"
#include "factors/make_reprojection_factor.h"
#include "test/backend/incremental/corridor.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/mixed_graphs/inertial_chain.h"
#include "test/backend/mixed_graphs/test_factors.h"

namespace hybrid_slam {
namespace {

double cpu_milliseconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

struct Times {
  std::vector<double> milliseconds;
  std::size_t most_moved = 0;
  int reached_all = 0;  // updates that moved more than half of the poses

  double mean(std::size_t from, std::size_t to) const {
    double sum = 0;
    for (std::size_t i = from; i < to; ++i) sum += milliseconds[i];
    return sum / static_cast<double>(to - from);
  }
};

Times run(MixedFeed& feed) {
  Times times;
  while (!feed.done()) {
    feed.add_next();
    const double start = cpu_milliseconds();
    const UpdateSummary summary = feed.solver().update();
    times.milliseconds.push_back(cpu_milliseconds() - start);
    times.most_moved = std::max(times.most_moved, summary.moved.size());
    if (2 * summary.moved.size() > feed.solver().pose_count()) ++times.reached_all;
  }
  return times;
}

void report(benchmark::State& state, const Times& times, IncrementalSolver& solver) {
  const std::size_t count = times.milliseconds.size();
  state.counters["mean_ms"] = times.mean(0, count);
  state.counters["early_ms"] = times.mean(count / 10, count / 5);
  state.counters["late_ms"] = times.mean(count - count / 10, count);
  state.counters["max_ms"] =
      *std::max_element(times.milliseconds.begin(), times.milliseconds.end());
  state.counters["reached_all"] = times.reached_all;
  const double start = cpu_milliseconds();
  const auto newest = static_cast<std::uint32_t>(solver.pose_count() - 1);
  for (int i = 0; i < 10; ++i) benchmark::DoNotOptimize(solver.covariance(newest));
  state.counters["covariance_ms"] = (cpu_milliseconds() - start) / 10;
  state.counters["excess"] = excess(solver);
}

// argument: whether with the blocks.
void chain(benchmark::State& state) {
  InertialChainOptions options;
  options.poses = 2000;
  options.laps = 6;
  options.loops = false;
  FactorGraph graph = inertial_chain(options).graph;
  if (state.range(0) == 0) {
    std::erase_if(graph.factors, [](const GraphFactor& factor) {
      return std::any_of(factor.variables.begin(), factor.variables.end(),
                         [](const auto& v) { return v.kind == GraphVariable::Kind::kBlock; });
    });
    graph.blocks.clear();
  }
  for (auto _ : state) {
    MixedFeed feed(graph, {});
    report(state, run(feed), feed.solver());
  }
}

// argument: whether the calibration varies.
void calibration(benchmark::State& state) {
  FactorGraph graph = corridor_graph(2000, 5);
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(graph.cameras[0].camera);
  GraphBlock block;
  block.values = Eigen::Map<const Eigen::VectorXd>(camera.params.data(), 5);
  const Eigen::Matrix<double, 5, 1> start = block.values;
  block.values.head<4>() += Eigen::Vector4d(2, -2, 1, 1);
  block.manifold = std::make_shared<ceres::SubsetManifold>(5, std::vector<int>{4});
  block.shared = true;
  block.fixed = state.range(0) == 0;
  if (block.fixed) block.values = start;
  graph.blocks.push_back(block);
  graph.factors.push_back({value_factor<5>(block.values, 5), {block_variable(0)}});
  for (const GraphObservation& seen : graph.observations) {
    graph.factors.push_back(
        {make_refining_reprojection_factor(graph.cameras[0].camera, seen.measurement, seen.sigma),
         {pose_variable(seen.frame), point_variable(seen.point), block_variable(0)}});
  }
  graph.observations.clear();
  for (auto _ : state) {
    MixedFeed feed(graph, {});
    report(state, run(feed), feed.solver());
  }
}

BENCHMARK(chain)->Arg(0)->Arg(1)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK(calibration)->Arg(0)->Arg(1)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace hybrid_slam
