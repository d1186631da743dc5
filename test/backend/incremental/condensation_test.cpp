// Landmarks that were not seen for a while, as terms on the poses that saw them.
#include <algorithm>

#include <catch2/catch.hpp>

#include "backend/incremental/incremental_solver.h"
#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "test/backend/incremental/corridor.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/incremental/lawn_mower.h"

namespace hybrid_slam {
namespace {

LawnMowerOptions small_survey() {
  LawnMowerOptions survey;
  survey.keyframes = 90;
  survey.per_track = 20;
  survey.observations_per_keyframe = 40;
  return survey;
}

IncrementalOptions condensing(int after) {
  IncrementalOptions options;
  options.condense_after = after;
  return options;
}

// A survey of which most is condensed, at rest.
struct Condensed {
  explicit Condensed(IncrementalOptions options = condensing(8))
      : feed(lawn_mower_graph(small_survey()), options) {
    while (!feed.done()) feed.feed_next();
    for (int i = 0; i < 5; ++i) feed.solver().update();
  }

  IncrementalSolver& solver() { return feed.solver(); }

  // A point that some old poses see.
  std::uint32_t old_point() {
    const FactorGraph graph = solver().graph();
    std::vector<std::uint32_t> oldest(graph.points.size(), 100);
    std::vector<std::uint32_t> newest(graph.points.size(), 0);
    for (const GraphObservation& seen : graph.observations) {
      oldest[seen.point] = std::min(oldest[seen.point], seen.frame);
      newest[seen.point] = std::max(newest[seen.point], seen.frame);
    }
    for (std::uint32_t i = 0; i < newest.size(); ++i) {
      if (oldest[i] > 20 && newest[i] > oldest[i] + 1 && newest[i] < oldest[i] + 10) return i;
    }
    throw std::logic_error("no such point");
  }

  // As if it was made from the start without condensing.
  void check_optimum() {
    for (int i = 0; i < 5; ++i) solver().update();
    CHECK(excess(solver()) < 1e-3);
  }

  GraphFeed feed;
};

double squared_chi(const IncrementalSolver& solver) {
  double sum = 0;
  const FactorGraph graph = solver.graph();
  for (std::uint32_t i = 0; i < graph.observations.size(); ++i) sum += solver.chi2(i);
  return sum;
}

TEST_CASE("condensed landmarks: most of a survey is, and the estimate is the batch optimum's") {
  Condensed survey;
  CHECK(survey.solver().condensed_count() > survey.solver().graph().points.size() / 2);
  CHECK(excess(survey.solver()) < 1e-3);
  Condensed whole(condensing(0));
  CHECK(whole.solver().condensed_count() == 0);
  CHECK(survey.solver().cost() == Approx(whole.solver().cost()).epsilon(1e-3));
}

TEST_CASE("condensed landmarks: their observations count in the cost and in what is exported") {
  Condensed survey;
  const FactorGraph graph = survey.solver().graph();
  CHECK(graph.observations.size() > 3000);
  CHECK(survey.solver().cost() == Approx(cost(graph)).epsilon(1e-9));
  CHECK(survey.solver().cost() == Approx(squared_chi(survey.solver()) / 2).epsilon(1e-9));
}

TEST_CASE("condensed landmarks: one that is seen again, loses a view or goes is taken out") {
  Condensed survey;
  IncrementalSolver& solver = survey.solver();
  const std::size_t before = solver.condensed_count();
  const std::uint32_t point = survey.old_point();
  const FactorGraph graph = solver.graph();
  const auto seen = std::find_if(graph.observations.begin(), graph.observations.end(),
                                 [&](const GraphObservation& o) { return o.point == point; });
  const auto index = static_cast<std::uint32_t>(seen - graph.observations.begin());
  SECTION("seen again") {
    GraphObservation again = *seen;
    again.measurement += Eigen::Vector3d(0.3, -0.2, 0.1);
    solver.add_observation(again);
  }
  SECTION("loses a view") { solver.remove_observation(index); }
  SECTION("goes") { solver.remove_point(point); }
  SECTION("its pose is fixed") { solver.set_fixed(pose_variable(seen->frame), true); }
  SECTION("its pose is marginalised") { solver.marginalize({pose_variable(seen->frame)}); }
  CHECK(solver.condensed_count() < before);
  survey.check_optimum();
}

TEST_CASE("condensed landmarks: a part of the map that is moved as one comes back") {
  Condensed survey;
  IncrementalSolver& solver = survey.solver();
  const double before = solver.cost();
  const Rigid3d by(so3_exp(Eigen::Vector3d(0.02, -0.01, 0.03)), Eigen::Vector3d(0.1, -0.05, 0.08));
  std::vector<std::pair<std::uint32_t, Rigid3d>> moves;
  for (std::uint32_t i = 30; i < solver.pose_count(); ++i) {
    moves.emplace_back(i, solver.pose(i) * inverse(by));
  }
  // What is seen from both sides of the border pulls it back.
  const Eigen::Vector3d point = solver.point(survey.old_point());
  solver.move_poses(moves);
  CHECK(solver.cost() > 10 * before);
  for (int i = 0; i < 30; ++i) solver.update();
  CHECK(solver.cost() == Approx(before).epsilon(1e-2));
  CHECK((solver.point(survey.old_point()) - point).norm() < 0.01);
}

TEST_CASE("condensed landmarks: poses that change their shape have them made anew") {
  Condensed survey;
  IncrementalSolver& solver = survey.solver();
  const double before = solver.cost();
  std::vector<std::pair<std::uint32_t, Rigid3d>> moves;
  for (std::uint32_t i = 20; i < 60; ++i) {
    Vector6d off;
    off << 0.05, -0.03, 0.04, 0.02, -0.01, 0.03;
    if (i % 2 == 0) off = -off;
    moves.emplace_back(i, se3_exp(off) * solver.pose(i));
  }
  solver.move_poses(moves);
  CHECK(solver.update().relinearized > 0);
  for (int i = 0; i < 10; ++i) solver.update();
  CHECK(solver.cost() == Approx(before).epsilon(1e-3));
}

TEST_CASE("condensed landmarks: covariances are those of the whole") {
  Condensed survey;
  Condensed whole(condensing(0));
  const auto newest = static_cast<std::uint32_t>(survey.solver().pose_count() - 1);
  const std::vector<GraphVariable> variables{pose_variable(newest),
                                             point_variable(survey.old_point())};
  const Eigen::MatrixXd of_condensed = survey.solver().covariance(variables);
  const Eigen::MatrixXd of_whole = whole.solver().covariance(variables);
  CHECK((of_condensed - of_whole).norm() < 0.01 * of_whole.norm());
}

TEST_CASE("condensed landmarks: long tracks are, too, however many poses they have") {
  const FactorGraph graph = corridor_graph(240, 1, 0.14);
  GraphFeed feed(graph, {});
  std::size_t most_live = 0;
  while (!feed.done()) {
    feed.feed_next();
    const IncrementalSolver& solver = feed.solver();
    if (solver.pose_count() % 40 != 0) continue;
    const std::size_t points = solver.graph().points.size();
    most_live = std::max(most_live, points - solver.condensed_count());
  }
  std::vector<int> views(graph.points.size(), 0);
  for (const GraphObservation& seen : graph.observations) ++views[seen.point];
  std::sort(views.begin(), views.end());
  // Most are seen by 40 poses and more, those at both ends by fewer.
  REQUIRE(views[views.size() / 3] >= 40);
  // Those in sight, 50, and what the 30 newest poses and ten more still saw.
  CHECK(most_live < 120);
  for (int i = 0; i < 5; ++i) feed.solver().update();
  CHECK(excess(feed.solver()) < 1e-4);
}

TEST_CASE("condensed landmarks: what an update looks at does not grow with the survey", "[slow]") {
  LawnMowerOptions options;
  options.keyframes = 1000;
  options.observations_per_keyframe = 60;
  GraphFeed feed(lawn_mower_graph(options), {});
  std::size_t most_early = 0;
  std::size_t most_late = 0;
  std::size_t points = 0;
  std::size_t evaluated_early = 0;
  std::size_t evaluated_late = 0;
  while (!feed.done()) {
    const std::size_t evaluated = feed.feed_next().evaluated;
    const std::size_t count = feed.solver().pose_count();
    if (count > 400 && count <= 600) evaluated_early += evaluated;
    if (count > 800) evaluated_late += evaluated;
    if (count % 20 != 0) continue;
    points = feed.solver().graph().points.size();
    const std::size_t live = points - feed.solver().condensed_count();
    if (count > 200 && count <= 400) most_early = std::max(most_early, live);
    if (count > 800) most_late = std::max(most_late, live);
  }
  CHECK(static_cast<double>(most_late) < 1.25 * static_cast<double>(most_early));
  CHECK(most_late < points / 4);
  CHECK(static_cast<double>(evaluated_late) < 1.25 * static_cast<double>(evaluated_early));
  CHECK(excess(feed.solver()) < 0.01);
}

}  // namespace
}  // namespace hybrid_slam
