#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/incremental/scene_graph.h"
#include "test/support/pose_graphs.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// An arc over a seafloor with a pair and, if asked for, a fisheye, from disturbed starts.
FactorGraph arc(int times, bool fisheye, int landmarks = 200) {
  SyntheticSceneOptions options;
  options.times = times;
  options.step = 0.45;
  options.fisheye = fisheye;
  options.landmarks = landmarks;
  FactorGraph graph = scene_graph(options);
  disturb(graph, 0.02, 0.01, 0.05, 5);
  return graph;
}

// Lets the solver come to rest.
void settle(IncrementalSolver& solver, int updates) {
  for (int i = 0; i < updates; ++i) solver.update();
}

// A solver that lets nothing pass.
IncrementalOptions exact() {
  IncrementalOptions options;
  options.relinearization = 1e-12;
  options.worst_mismatch = 1e-6;
  options.wildfire = 1e-12;
  options.budget = 1e12;
  return options;
}

TEST_CASE("incremental edits: without some observations, the optimum of the others") {
  GraphFeed feed(arc(20, true), {});
  IncrementalSolver& solver = feed.solver();
  Random random(3);
  while (!feed.done()) {
    feed.add_next();
    const auto count = static_cast<std::uint32_t>(solver.graph().observations.size());
    // Some at once, before they were ever linearised.
    for (int i = 0; i < 5; ++i) {
      solver.remove_observation(static_cast<std::uint32_t>(random.below(count)));
    }
    solver.update();
  }
  settle(solver, 2);
  CHECK(excess(solver) < 0.01);
}

TEST_CASE("incremental edits: what is removed leaves no trace") {
  const FactorGraph graph = arc(12, false);
  GraphFeed feed(graph, exact());
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  settle(solver, 5);
  const FactorGraph before = solver.graph();

  const auto pose = solver.add_pose({graph.frames[6].cam_from_world, 0, false});
  const auto point = solver.add_point(before.points[0].in_world);
  std::vector<std::uint32_t> added;
  for (const GraphObservation& observation : before.observations) {
    if (observation.frame != 6) continue;
    GraphObservation wrong = observation;
    wrong.frame = pose;
    wrong.measurement += Eigen::Vector3d(30, 5, 20);
    added.push_back(solver.add_observation(wrong));
    wrong.frame = 4;
    wrong.point = point;
    if (added.size() == 1) added.push_back(solver.add_observation(wrong));
  }
  REQUIRE(added.size() > 20);
  settle(solver, 3);
  CHECK(cost(solver.graph()) > 1.05 * cost(before));
  for (const std::uint32_t observation : added) {
    solver.remove_observation(observation);
    solver.remove_observation(observation);  // once is enough
  }
  settle(solver, 5);
  const FactorGraph after = solver.graph();
  CHECK(after.observations.size() == before.observations.size());
  CHECK(cost(after) == Approx(cost(before)).epsilon(1e-6));
  for (std::size_t i = 0; i < before.frames.size(); ++i) {
    CHECK((after.frames[i].cam_from_world.params - before.frames[i].cam_from_world.params).norm() <
          1e-4);
  }
}

TEST_CASE("incremental edits: a point seen twice by one frame loses one view, not both") {
  const FactorGraph graph = arc(8, false);
  GraphFeed feed(graph, exact());
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  settle(solver, 5);
  const FactorGraph before = solver.graph();
  std::vector<std::uint32_t> added;
  for (const GraphObservation& observation : before.observations) {
    GraphObservation again = observation;
    again.measurement += Eigen::Vector3d(1, -1, 0);
    if (observation.frame == 5) added.push_back(solver.add_observation(again));
  }
  settle(solver, 3);
  CHECK(excess(solver) < 1e-6);
  CHECK(cost(solver.graph()) > 1.01 * cost(before));
  for (const std::uint32_t observation : added) solver.remove_observation(observation);
  settle(solver, 5);
  CHECK(cost(solver.graph()) == Approx(cost(before)).epsilon(1e-6));
}

TEST_CASE("incremental edits: a wrong loop that goes again") {
  Random random(2);
  TestPoseGraph grid = grid_pose_graph({4, 4, 3}, {0.05, 0.03}, random);
  disturb(grid.graph, 0.1, 0.1, 0, 12);
  for (const bool is_exact : {true, false}) {
    GraphFeed feed(grid.graph, is_exact ? exact() : IncrementalOptions{});
    while (!feed.done()) feed.feed_next();
    IncrementalSolver& solver = feed.solver();
    settle(solver, 5);
    const double before = cost(solver.graph());

    GraphEdge wrong = grid.graph.edges[0];
    wrong.a = 3;
    wrong.b = 40;
    const std::uint32_t edge = solver.add_edge(wrong);
    settle(solver, 3);
    CHECK(cost(solver.graph()) > 2 * before);
    solver.remove_edge(edge);
    settle(solver, 10);
    CHECK(solver.graph().edges.size() == grid.graph.edges.size());
    CHECK(cost(solver.graph()) == Approx(before).epsilon(is_exact ? 1e-6 : 1e-3));
  }
}

TEST_CASE("incremental edits: an edge takes the place of one that went") {
  Random random(2);
  TestPoseGraph grid = grid_pose_graph({4, 4, 3}, {0.05, 0.03}, random);
  disturb(grid.graph, 0.1, 0.1, 0, 12);
  for (const bool updated_between : {true, false}) {
    GraphFeed feed(grid.graph, exact());
    while (!feed.done()) feed.feed_next();
    IncrementalSolver& solver = feed.solver();
    settle(solver, 5);
    const double before = cost(solver.graph());
    const std::uint32_t gone = 5;
    const GraphEdge right = solver.graph().edges[gone];
    for (int round = 0; round < 3; ++round) {  // elsewhere, and back again
      GraphEdge wrong = right;
      wrong.a = 3;
      wrong.b = 40;
      solver.remove_edge(gone);
      if (updated_between) solver.update();
      CHECK(solver.add_edge(wrong) == gone);
      settle(solver, 3);
      CHECK(cost(solver.graph()) > 2 * before);
      CHECK(excess(solver) < 1e-3);
      solver.remove_edge(gone);
      if (updated_between) solver.update();
      CHECK(solver.add_edge(right) == gone);
      settle(solver, 10);
      CHECK(solver.graph().edges.size() == grid.graph.edges.size());
      CHECK(cost(solver.graph()) == Approx(before).epsilon(1e-6));
    }
  }
}

TEST_CASE("incremental edits: a pose takes the place of one that went") {
  const FactorGraph graph = arc(12, false);
  GraphFeed feed(graph, exact());
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  settle(solver, 5);
  const FactorGraph before = solver.graph();
  const std::size_t count = solver.pose_count();
  for (std::uint32_t round = 0; round < 8; ++round) {
    const std::uint32_t like = 3 + round;  // another place each time
    Rigid3d start = before.frames[like].cam_from_world;
    start.translation() += Eigen::Vector3d(0.02, -0.01, 0.03);
    const std::uint32_t pose = solver.add_pose({start, 0, false});
    CHECK(pose == count);
    std::vector<std::uint32_t> added;
    for (GraphObservation observation : before.observations) {
      if (observation.frame != like) continue;
      observation.frame = pose;
      added.push_back(solver.add_observation(observation));
    }
    REQUIRE(added.size() > 20);
    CHECK(!solver.remove_pose(pose));
    settle(solver, 5);
    CHECK(excess(solver) < 1e-6);
    CHECK((solver.pose(pose).params - solver.pose(like).params).norm() < 1e-6);
    for (const std::uint32_t observation : added) solver.remove_observation(observation);
    CHECK(!solver.remove_pose(pose));  // not before an update
    settle(solver, 5);
    CHECK(solver.remove_pose(pose));
    CHECK(!solver.remove_pose(pose));  // once
    CHECK(cost(solver.graph()) == Approx(cost(before)).epsilon(1e-6));
  }
  CHECK(solver.pose_count() == count + 1);
  CHECK(!solver.remove_pose(0));
  CHECK_THROWS_AS(solver.remove_pose(1000), std::logic_error);
}

TEST_CASE("incremental edits: two runs are the same, bit by bit") {
  const FactorGraph graph = arc(15, true);
  GraphFeed first(graph, {});
  GraphFeed second(graph, {});
  Random random(1);
  while (!first.done()) {
    const UpdateSummary a = first.feed_next();
    const UpdateSummary b = second.feed_next();
    CHECK(a.multiplications == b.multiplications);
    CHECK(a.relinearized == b.relinearized);
    const auto removed =
        static_cast<std::uint32_t>(random.below(first.solver().graph().observations.size()));
    first.solver().remove_observation(removed);
    second.solver().remove_observation(removed);
  }
  const FactorGraph a = first.solver().graph();
  const FactorGraph b = second.solver().graph();
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    CHECK(a.frames[i].cam_from_world.params == b.frames[i].cam_from_world.params);
  }
  bool same = a.points.size() == b.points.size();
  for (std::size_t i = 0; same && i < a.points.size(); ++i) {
    same = a.points[i].in_world == b.points[i].in_world;
  }
  CHECK(same);
}

TEST_CASE("incremental edits: poses and points that little holds stay finite and harm nobody") {
  const FactorGraph graph = arc(10, true);
  GraphFeed plain(graph, exact());
  GraphFeed feed(graph, exact());
  IncrementalSolver& solver = feed.solver();
  while (!feed.done()) {
    plain.feed_next();
    feed.feed_next();
  }
  const double alone = cost(plain.solver().graph());
  const Rigid3d somewhere(Eigen::Quaterniond::Identity(), {1, 2, 3});
  const std::uint32_t idle = solver.add_pose({somewhere, 0, false});  // no terms at all
  // A pair with a point that nobody else sees, and a fisheye with another.
  const std::uint32_t pair = solver.add_pose({somewhere, 0, false});
  const Eigen::Vector3d before_it = inverse(somewhere) * Eigen::Vector3d(0, 0, 4);
  solver.add_observation({pair, solver.add_point(before_it), {319, 240, 305}, 1});
  const std::uint32_t fisheye = solver.add_pose({somewhere, 1, false});
  const std::uint32_t ray = solver.add_point(before_it);
  solver.add_observation({fisheye, ray, {390, 410, kNaN}, 1});
  settle(solver, 3);

  for (const std::uint32_t pose : {idle, pair, fisheye}) {
    CHECK((solver.pose(pose).params - somewhere.params).norm() < 1e-6);
  }
  CHECK(solver.point(ray) == before_it);
  const double ray_cost = 0.5 * chi2(solver.graph(), solver.graph().observations.back());
  CHECK(cost(solver.graph()) - ray_cost == Approx(alone).epsilon(1e-6));
}

TEST_CASE("incremental edits: an edge to a fixed pose holds the other") {
  IncrementalSolver solver(exact());
  Random random(6);
  const Rigid3d known = random.rigid(3, 2);
  const Rigid3d free_from_known = random.rigid(1, 1);
  const std::uint32_t fixed = solver.add_pose({known, GraphFrame::kNoCamera, true});
  const Rigid3d start = se3_exp(Vector6d::Constant(0.2)) * free_from_known * known;
  const std::uint32_t free = solver.add_pose({start, GraphFrame::kNoCamera, false});
  GraphEdge edge;
  edge.a = fixed;
  edge.b = free;
  edge.a_from_b = inverse(free_from_known);
  solver.add_edge(edge);
  settle(solver, 3);
  CHECK(solver.pose(fixed).params == known.params);
  CHECK(se3_log(solver.pose(free) * inverse(free_from_known * known)).norm() < 1e-9);
  // One between two fixed poses is a constant.
  edge.b = solver.add_pose({start, GraphFrame::kNoCamera, true});
  solver.add_edge(edge);
  settle(solver, 1);
  CHECK(solver.pose(edge.b).params == start.params);
}

TEST_CASE("incremental edits: a point that a step takes behind its cameras comes back") {
  const FactorGraph truth = arc(6, false);
  GraphFeed feed(truth, {});
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  settle(solver, 3);
  // Two metres ahead of the third frame, as three frames see it; taken for a hundred metres away:
  // linearised there, the disparities lead far behind the cameras.
  const Eigen::Vector3d place = inverse(solver.pose(2)) * Eigen::Vector3d(0.1, 0.1, 2);
  const Eigen::Vector3d far_away = inverse(solver.pose(2)) * Eigen::Vector3d(5, 5, 100);
  const std::uint32_t point = solver.add_point(far_away);
  for (const std::uint32_t frame : {1U, 2U, 3U}) {
    const Camera& camera = truth.cameras[0].camera;
    const auto seen = project_stereo(camera, solver.pose(frame) * place);
    REQUIRE(seen);
    solver.add_observation({frame, point, *seen, 0.5});
  }
  settle(solver, 10);
  CHECK((solver.point(point) - place).norm() < 0.02);
  CHECK(excess(solver) < 0.01);
}

TEST_CASE("incremental edits: numbers that are none do not get in") {
  const FactorGraph graph = arc(5, false);
  GraphFeed feed(graph, {});
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  const FactorGraph before = solver.graph();

  GraphFrame pose = before.frames[0];
  pose.cam_from_world.params[5] = kNaN;
  CHECK_THROWS_AS(solver.add_pose(pose), std::logic_error);
  CHECK_THROWS_AS(solver.add_point({0, kInfinity, 1}), std::logic_error);
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    GraphObservation observation = before.observations[0];
    observation.measurement[0] = bad;
    CHECK_THROWS_AS(solver.add_observation(observation), std::logic_error);
    observation = before.observations[0];
    observation.sigma = bad;
    CHECK_THROWS_AS(solver.add_observation(observation), std::logic_error);
  }
  GraphObservation observation = before.observations[0];
  observation.measurement[2] = kInfinity;  // NaN: no right match
  CHECK_THROWS_AS(solver.add_observation(observation), std::logic_error);
  observation = before.observations[0];
  observation.frame = 77;
  CHECK_THROWS_AS(solver.add_observation(observation), std::logic_error);

  GraphEdge edge;
  edge.a = 1;
  edge.b = 2;
  GraphEdge bad = edge;
  bad.information(3, 3) = kNaN;
  CHECK_THROWS_AS(solver.add_edge(bad), std::logic_error);
  bad = edge;
  bad.a_from_b.params[0] = kNaN;
  CHECK_THROWS_AS(solver.add_edge(bad), std::logic_error);
  bad = edge;
  bad.b = 1;
  CHECK_THROWS_AS(solver.add_edge(bad), std::logic_error);
  CHECK_THROWS_AS(solver.remove_edge(0), std::logic_error);

  settle(solver, 1);
  const FactorGraph after = solver.graph();
  CHECK(after.observations.size() == before.observations.size());
  CHECK(after.frames.size() == before.frames.size());
  CHECK(after.edges.empty());
  CHECK(after.validate().empty());
  CHECK(excess(solver) < 0.01);
}

TEST_CASE("incremental edits: options without sense are refused") {
  for (double IncrementalOptions::*option :
       {&IncrementalOptions::relinearization, &IncrementalOptions::worst_mismatch,
        &IncrementalOptions::wildfire, &IncrementalOptions::budget, &IncrementalOptions::burst,
        &IncrementalOptions::chi2_mono, &IncrementalOptions::chi2_stereo}) {
    IncrementalOptions options;
    for (const double bad : {-1., kNaN}) {
      options.*option = bad;
      CHECK_THROWS_AS(IncrementalSolver(options), std::invalid_argument);
    }
  }
}

}  // namespace
}  // namespace hybrid_slam
