#include "backend/problem/problem_builder.h"

#include <ceres/problem.h>

#include <cmath>

#include "backend/problem/full_bundle.h"
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
  AssembledProblem assembled = assemble_problem(filled.map.view(), config);
  double expected = 0;
  int stereo = 0;
  int residuals = 0;
  for (const ProblemTerm& term : assembled.terms) {
    const double squared = chi2(assembled, term);
    const double threshold = std::sqrt(term.stereo ? 7.815 : 5.991);
    const double norm = std::sqrt(squared);
    expected += robust && norm > threshold ? threshold * (2 * norm - threshold) / 2 : squared / 2;
    residuals += term.stereo ? 3 : 2;
    stereo += term.stereo ? 1 : 0;
  }
  REQUIRE(stereo > 100);
  REQUIRE(assembled.terms.size() > static_cast<std::size_t>(stereo + 100));
  const auto problem = build_ceres_problem(assembled, config.options, robust);
  double cost = 0;
  problem->Evaluate({}, &cost, nullptr, nullptr, nullptr);
  CHECK(cost == Approx(expected).epsilon(1e-10));
  CHECK(problem->NumResiduals() == residuals);
}

TEST_CASE("Terms set aside, and what only they concern, are not in the problem") {
  const SyntheticScene scene = make_synthetic_scene({.times = 4, .landmarks = 300});
  const FilledMap filled = fill_map(scene, {});
  const ProblemConfig config = make_full_bundle(filled.map.view(), {});
  AssembledProblem assembled = assemble_problem(filled.map.view(), config);
  int active = 0;
  for (ProblemTerm& term : assembled.terms) {
    term.active = term.point % 2 == 0 && term.pose != 1;
    if (term.active) active += term.stereo ? 3 : 2;
  }
  const auto problem = build_ceres_problem(assembled, config.options, true);
  CHECK(problem->NumResiduals() == active);
  CHECK_FALSE(problem->HasParameterBlock(assembled.poses[1].params.data()));
  CHECK_FALSE(problem->HasParameterBlock(assembled.points[1].data()));
  CHECK(problem->IsParameterBlockConstant(assembled.poses[3].params.data()));
  CHECK_FALSE(problem->IsParameterBlockConstant(assembled.poses[0].params.data()));
}

}  // namespace
}  // namespace hybrid_slam
