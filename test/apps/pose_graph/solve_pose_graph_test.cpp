#include "apps/pose_graph/solve_pose_graph.h"

#include "apps/pose_graph/pose_graph_descent.h"
#include "cameras/geometry/se3.h"
#include "test/support/pose_graphs.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

constexpr PoseNoise kNoise{0.05, 0.05};

// Information of any shape: the noise stays, what the solver believes of it changes.
void make_anisotropic(FactorGraph& graph, Random& random) {
  for (GraphEdge& edge : graph.edges) {
    const Eigen::MatrixXd m = Matrix6d::NullaryExpr([&] { return random.uniform(-1, 1); });
    edge.information = 100 * (m * m.transpose() + 0.1 * Matrix6d::Identity());
  }
}

double largest_difference(const FactorGraph& a, const FactorGraph& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    const Rigid3d difference = a.frames[i].cam_from_world * inverse(b.frames[i].cam_from_world);
    largest = std::max(largest, se3_log(difference).norm());
  }
  return largest;
}

FactorGraph solved_by_ceres(FactorGraph graph) {
  ProblemOptions options;
  options.rounds = {{100, Loss::kNone, 1e-14}};
  REQUIRE(solve_graph(graph, options).end == SolveEnd::kConverged);
  return graph;
}

std::vector<Rigid3d> poses_of(const FactorGraph& graph) {
  return start_poses(graph, PoseGraphStart::kGiven);
}

TEST_CASE("descent and Ceres find the same optimum, whatever the information") {
  Random random(1);
  TestPoseGraph test = grid_pose_graph({4, 4, 3}, kNoise, random);
  make_anisotropic(test.graph, random);
  const FactorGraph expected = solved_by_ceres(test.graph);
  FactorGraph graph = test.graph;
  PoseGraphOptions options;
  options.starts = {PoseGraphStart::kGiven};
  options.function_tolerance = 1e-12;
  const PoseGraphSummary result = solve_pose_graph(graph, options);
  CHECK(result.summary.end == SolveEnd::kConverged);
  CHECK(result.summary.initial_cost == Approx(cost(test.graph)).epsilon(1e-12));
  CHECK(result.summary.final_cost == Approx(cost(expected)).epsilon(1e-10));
  CHECK(cost(graph) == Approx(result.summary.final_cost).epsilon(1e-12));
  CHECK(largest_difference(graph, expected) < 1e-5);
}

TEST_CASE("a factor serves more than one step") {
  Random random(2);
  const TestPoseGraph test = grid_pose_graph({5, 5, 2}, {0.01, 0.01}, random);
  const PoseGraphProblem problem(test.graph);
  std::vector<Rigid3d> poses = poses_of(test.graph);
  PoseGraphDescentOptions options;
  options.function_tolerance = 1e-12;
  const PoseGraphDescent descent = problem.descend(poses, options);
  CHECK(descent.end == DescentEnd::kConverged);
  CHECK(descent.iterations >= 3);
  CHECK(descent.factorizations < descent.iterations);
  CHECK(descent.cost == Approx(problem.cost(poses)).epsilon(1e-12));
}

TEST_CASE("scattered poses: the descent never goes up, and the solver finds the way by a start") {
  Random random(3);
  TestPoseGraph test = grid_pose_graph({6, 5, 3}, kNoise, random);
  const FactorGraph expected = solved_by_ceres(test.graph);
  scatter(test.graph, random);
  const PoseGraphProblem problem(test.graph);
  int ended_uphill = 0;
  for (int trial = 0; trial < 10; ++trial) {
    scatter(test.graph, random);
    std::vector<Rigid3d> poses = poses_of(test.graph);
    double last = problem.cost(poses);
    const PoseGraphDescent descent = problem.descend(poses, {}, {}, [&](int, double cost) {
      CHECK(cost <= last);
      last = cost;
    });
    CHECK(problem.cost(poses) == Approx(descent.cost).epsilon(1e-12));
    ended_uphill += descent.end == DescentEnd::kUphill;
  }
  CHECK(ended_uphill > 0);

  FactorGraph graph = test.graph;
  const PoseGraphSummary result = solve_pose_graph(graph, {});
  CHECK(result.start == PoseGraphStart::kRotations);
  CHECK(result.attempts.size() == 1);  // it explains the noise: no other was needed
  CHECK(result.summary.final_cost == Approx(cost(expected)).epsilon(1e-6));
}

TEST_CASE("where no solution explains the noise every start is tried and the lowest cost kept") {
  for (std::uint64_t seed = 40; seed < 50; ++seed) {
    Random random(seed);
    TestPoseGraph test = grid_pose_graph({4, 4, 2}, kNoise, random);
    for (std::size_t e = 0; e < test.graph.edges.size(); e += 5) {
      GraphEdge& edge = test.graph.edges[e];
      edge.a_from_b = edge.a_from_b * random.rigid(2, 2);
    }
    scatter(test.graph, random);
    const PoseGraphSummary result = solve_pose_graph(test.graph, {});
    REQUIRE(result.attempts.size() == 3);
    double lowest = result.attempts[0].cost;
    double last_start = 0;
    for (const PoseGraphAttempt& attempt : result.attempts) {
      lowest = std::min(lowest, attempt.cost);
      CHECK(attempt.cost <= attempt.start_cost);
      CHECK(attempt.start_cost >= last_start);
      last_start = attempt.start_cost;
      if (attempt.start == result.start) CHECK(attempt.cost == result.summary.final_cost);
    }
    CHECK(result.summary.final_cost == lowest);
    CHECK(cost(test.graph) == Approx(lowest).epsilon(1e-12));
  }
}

TEST_CASE("exact measurements end at the truth, also where the file starts there") {
  Random random(5);
  TestPoseGraph test = grid_pose_graph({3, 3, 3}, {}, random);
  FactorGraph scattered = test.graph;
  scatter(scattered, random);
  for (FactorGraph* graph : {&test.graph, &scattered}) {
    const PoseGraphSummary result = solve_pose_graph(*graph, {});
    CHECK(result.summary.end == SolveEnd::kConverged);
    CHECK(result.summary.final_cost < 1e-15);
    CHECK(largest_difference(*graph, test.graph) < 1e-9);
  }
}

TEST_CASE("a stop request ends the solver where it stands") {
  Random random(6);
  TestPoseGraph test = grid_pose_graph({4, 4, 2}, kNoise, random);
  const FactorGraph before = test.graph;
  std::stop_source source;
  source.request_stop();
  PoseGraphOptions options;
  options.starts = {PoseGraphStart::kGiven};
  const PoseGraphSummary result = solve_pose_graph(test.graph, options, source.get_token());
  CHECK(result.summary.end == SolveEnd::kStopped);
  CHECK(largest_difference(test.graph, before) < 1e-12);
}

TEST_CASE("what is no pose graph is refused") {
  Random random(7);
  TestPoseGraph test = grid_pose_graph({2, 2, 1}, {}, random);
  PoseGraphOptions none;
  none.starts.clear();
  CHECK_THROWS_AS(solve_pose_graph(test.graph, none), std::invalid_argument);
  test.graph.observations.emplace_back();
  CHECK_FALSE(is_pose_graph(test.graph));
  CHECK_THROWS_AS(solve_pose_graph(test.graph, {}), std::invalid_argument);
}

}  // namespace
}  // namespace hybrid_slam
