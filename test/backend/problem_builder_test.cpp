#include "backend/problem/problem_builder.h"

#include <ceres/problem.h>

#include <cmath>

#include "backend/problem/full_bundle.h"
#include "backend/problem/map_graph.h"
#include "test/support/filled_map.h"

// After Ceres, whose logging has a CHECK of its own.
#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

TEST_CASE("The problem given to Ceres has the cost of its terms") {
  const bool robust = GENERATE(false, true);
  const SyntheticScene scene =
      make_synthetic_scene({.times = 6, .fisheye = true, .landmarks = 600, .outlier_rate = 0.1});
  const FilledMap filled =
      fill_map(scene, {.rotation_noise = 0.005, .translation_noise = 0.01, .point_noise = 0.02});
  const ProblemConfig config = make_full_bundle(filled.map.view(), {});
  FactorGraph graph = make_graph(filled.map.view(), config).graph;
  const GraphFactors factors = make_factors(graph);
  const std::vector<double> values = observations_chi2(graph, factors);
  double expected = 0;
  int stereo = 0;
  int residuals = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool has_right = residual_count(factors, i) == 3;
    const double threshold = std::sqrt(has_right ? 7.815 : 5.991);
    const double norm = std::sqrt(values[i]);
    expected += robust && norm > threshold ? threshold * (2 * norm - threshold) / 2 : values[i] / 2;
    residuals += has_right ? 3 : 2;
    stereo += has_right ? 1 : 0;
  }
  REQUIRE(stereo > 100);
  REQUIRE(values.size() > static_cast<std::size_t>(stereo + 100));
  const auto problem =
      build_ceres_problem(graph, factors, config.options, robust ? Loss::kHuber : Loss::kNone);
  double cost = 0;
  problem->Evaluate({}, &cost, nullptr, nullptr, nullptr);
  CHECK(cost == Approx(expected).epsilon(1e-10));
  CHECK(problem->NumResiduals() == residuals);
}

TEST_CASE("Terms set aside, and what only they concern, are not in the problem") {
  const SyntheticScene scene = make_synthetic_scene({.times = 4, .landmarks = 300});
  const FilledMap filled = fill_map(scene, {});
  const ProblemConfig config = make_full_bundle(filled.map.view(), {});
  FactorGraph graph = make_graph(filled.map.view(), config).graph;
  GraphFactors factors = make_factors(graph);
  int active = 0;
  for (std::size_t i = 0; i < graph.observations.size(); ++i) {
    const GraphObservation& observation = graph.observations[i];
    factors.active[i] = observation.point % 2 == 0 && observation.frame != 1 ? 1 : 0;
    if (factors.active[i] != 0) active += residual_count(factors, i);
  }
  const auto problem = build_ceres_problem(graph, factors, config.options, Loss::kHuber);
  const auto pose = [&](std::size_t i) { return graph.frames[i].cam_from_world.params.data(); };
  CHECK(problem->NumResiduals() == active);
  CHECK_FALSE(problem->HasParameterBlock(pose(1)));
  CHECK_FALSE(problem->HasParameterBlock(graph.points[1].in_world.data()));
  CHECK(problem->IsParameterBlockConstant(pose(3)));
  CHECK_FALSE(problem->IsParameterBlockConstant(pose(0)));
}

}  // namespace
}  // namespace hybrid_slam
