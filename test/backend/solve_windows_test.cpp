// Bundle adjustment of a graph that is larger than what may vary at once.
#include "backend/problem/solve_windows.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>
#include <stop_token>

#include "cameras/geometry/se3.h"
#include "test/backend/incremental/lawn_mower.h"

namespace hybrid_slam {
namespace {

// A survey of four tracks that overlap, and so see part of the ground a track later again.
FactorGraph survey() {
  LawnMowerOptions options;
  options.keyframes = 120;
  options.per_track = 30;
  options.observations_per_keyframe = 60;
  return lawn_mower_graph(options);
}

ProblemOptions without_outliers() {
  ProblemOptions options;
  options.rounds = {{50, Loss::kNone, 1e-9}};
  options.chi2_mono = options.chi2_stereo = 60;
  return options;
}

TEST_CASE("windows: a map of four times the limit comes within a percent of the whole's cost") {
  FactorGraph whole = survey();
  FactorGraph parts = whole;
  const double start = cost(whole);
  const GraphSummary at_once = solve_graph(whole, without_outliers());
  const GraphSummary in_windows = solve_windows(parts, 30, without_outliers());
  INFO("cost " << start << ", at once " << cost(whole) << ", in windows " << cost(parts));
  // Half the noise of all measurements, of three rows, but for what is estimated from them.
  std::set<std::uint32_t> seen;
  for (const GraphObservation& observation : whole.observations) seen.insert(observation.point);
  const double freedom = 3.0 * static_cast<double>(whole.observations.size()) -
                         6.0 * static_cast<double>(whole.frames.size() - 1) -
                         3.0 * static_cast<double>(seen.size());
  CHECK(cost(whole) == Approx(freedom / 2).epsilon(0.05));
  CHECK(start > 10 * cost(whole));
  CHECK(cost(parts) < 1.01 * cost(whole));
  CHECK(cost(parts) >= (1 - 1e-9) * cost(whole));
  CHECK(in_windows.end == SolveEnd::kConverged);
  CHECK(in_windows.initial_cost == Approx(at_once.initial_cost));
  CHECK(in_windows.final_cost == Approx(cost(parts)));
  CHECK(parts.frames[0].cam_from_world.params == whole.frames[0].cam_from_world.params);
}

TEST_CASE("windows: one that holds all is the whole problem") {
  FactorGraph whole = survey();
  FactorGraph parts = whole;
  solve_graph(whole, without_outliers());
  solve_windows(parts, whole.frames.size(), without_outliers());
  CHECK(cost(parts) == Approx(cost(whole)).epsilon(1e-9));
}

TEST_CASE("windows: wrong observations are told by their place in the whole graph") {
  FactorGraph graph = survey();
  std::vector<std::uint32_t> wrong;
  for (std::uint32_t i = 100; i < graph.observations.size(); i += 500) {
    graph.observations[i].measurement[1] += 40;
    wrong.push_back(i);
  }
  ProblemOptions options = without_outliers();
  options.rounds = {{30, Loss::kHuber, 1e-6}, {20, Loss::kNone, 1e-8}};
  const GraphSummary summary = solve_windows(graph, 30, options);
  for (const std::uint32_t i : wrong) {
    CHECK(std::count(summary.outliers.begin(), summary.outliers.end(), i) == 1);
  }
  CHECK(summary.outliers.size() < 2 * wrong.size());
  CHECK(summary.kept_final_cost < 0.5 * summary.final_cost);
}

TEST_CASE("windows: one that is stopped ends all, and other terms are refused") {
  FactorGraph graph = survey();
  std::stop_source stop;
  stop.request_stop();
  CHECK(solve_windows(graph, 30, without_outliers(), stop.get_token()).end == SolveEnd::kStopped);
  CHECK_THROWS_AS(solve_windows(graph, 1, without_outliers()), std::invalid_argument);
  graph.similarities.emplace_back();
  CHECK_THROWS_AS(solve_windows(graph, 30, without_outliers()), std::invalid_argument);
}

}  // namespace
}  // namespace hybrid_slam
