#include "backend/problem/problem_builder.h"

#include <ceres/problem.h>

#include <cmath>

#include "backend/problem/full_bundle.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/solve_graph.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"

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
  const std::vector<double> values = observations_chi2(graph);
  double expected = 0;
  int stereo = 0;
  int residuals = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool has_right = residual_count(graph, graph.observations[i]) == 3;
    const double threshold = std::sqrt(has_right ? 7.815 : 5.991);
    const double norm = std::sqrt(values[i]);
    expected += robust && norm > threshold ? threshold * (2 * norm - threshold) / 2 : values[i] / 2;
    residuals += has_right ? 3 : 2;
    stereo += has_right ? 1 : 0;
  }
  REQUIRE(stereo > 100);
  REQUIRE(values.size() > static_cast<std::size_t>(stereo + 100));
  const CeresGraph built =
      build_ceres_problem(graph, factors, config.options, robust ? Loss::kHuber : Loss::kNone);
  double cost = 0;
  built.problem->Evaluate({}, &cost, nullptr, nullptr, nullptr);
  CHECK(cost == Approx(expected).epsilon(1e-10));
  CHECK(built.problem->NumResiduals() == residuals);
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
    if (factors.active[i] != 0) active += residual_count(graph, graph.observations[i]);
  }
  const CeresGraph built = build_ceres_problem(graph, factors, config.options, Loss::kHuber);
  const auto pose = [&](std::size_t i) { return graph.frames[i].cam_from_world.params.data(); };
  CHECK(built.problem->NumResiduals() == active);
  CHECK_FALSE(built.problem->HasParameterBlock(pose(1)));
  CHECK_FALSE(built.problem->HasParameterBlock(graph.points[1].in_world.data()));
  CHECK(built.problem->IsParameterBlockConstant(pose(3)));
  CHECK_FALSE(built.problem->IsParameterBlockConstant(pose(0)));
}

TEST_CASE("A frame with a camera of its own is one block, with the same cost and solution") {
  Random random(8);
  FactorGraph graph;
  for (std::uint32_t i = 0; i < 4; ++i) {
    graph.cameras.push_back({Calibrated<Pinhole>{{500, 510, 320, 240}, 640, 480}, 0b0011});
    const Rigid3d pose({1, 0, 0, 0}, {-0.5 * i, 0.02 * i, 0.1 * i});
    graph.frames.push_back({pose, i, i == 0});
  }
  graph.frames[1].fixed = true;  // holds the scale
  for (std::uint32_t p = 0; p < 60; ++p) {
    graph.points.push_back({{random.uniform(-2, 2), random.uniform(-1, 1), random.uniform(3, 6)}});
    for (std::uint32_t i = 0; i < 4; ++i) {
      const auto pixel = project(graph.cameras[i].camera,
                                 graph.frames[i].cam_from_world * graph.points[p].in_world);
      graph.observations.push_back({i, p, {pixel->x(), pixel->y(), 0}, 1});
    }
  }
  const FactorGraph truth = graph;
  for (GraphPoint& point : graph.points) point.in_world += random.gaussian3(0.02);
  for (std::uint32_t i = 2; i < 4; ++i) {
    graph.frames[i].cam_from_world.translation() += random.gaussian3(0.02);
    params_of(graph.cameras[i].camera)[0] += 8;
  }

  const GraphFactors factors = make_factors(graph);
  const CeresGraph built = build_ceres_problem(graph, factors, {}, Loss::kNone);
  double built_cost = 0;
  built.problem->Evaluate({}, &built_cost, nullptr, nullptr, nullptr);
  CHECK(built_cost == Approx(cost(graph)).epsilon(1e-12));
  REQUIRE(built.joint_frames[2].size() == 11);
  CHECK(built.problem->ParameterBlockTangentSize(built.joint_frames[2].data()) == 8);
  CHECK_FALSE(built.problem->HasParameterBlock(graph.frames[2].cam_from_world.params.data()));

  ProblemOptions options;
  options.rounds = {{50, Loss::kNone, 1e-14}};
  const GraphSummary summary = solve_graph(graph, options);
  CHECK(summary.final_cost < 1e-12 * summary.initial_cost);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK((graph.frames[i].cam_from_world.params - truth.frames[i].cam_from_world.params).norm() <
          1e-5);
    const auto& camera = std::get<Calibrated<Pinhole>>(graph.cameras[i].camera);
    CHECK(camera.params[0] == Approx(500).epsilon(1e-5));
    CHECK(camera.params[2] == 320);
  }
}

}  // namespace
}  // namespace hybrid_slam
