#include "apps/pose_graph/pose_graph_start.h"

#include "cameras/geometry/se3.h"
#include "test/support/pose_graphs.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

constexpr PoseGraphStart kComputed[] = {PoseGraphStart::kTree, PoseGraphStart::kRotations};

double largest_error(const std::vector<Rigid3d>& poses, const std::vector<Rigid3d>& truth) {
  double largest = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    largest = std::max(largest, se3_log(poses[i] * inverse(truth[i])).norm());
  }
  return largest;
}

FactorGraph moved_to(const FactorGraph& graph, const std::vector<Rigid3d>& poses) {
  FactorGraph moved = graph;
  for (std::size_t i = 0; i < poses.size(); ++i) moved.frames[i].cam_from_world = poses[i];
  return moved;
}

TEST_CASE("exact measurements give exact poses, whatever the given ones") {
  Random random(1);
  TestPoseGraph test = grid_pose_graph({4, 5, 3}, {}, random);
  scatter(test.graph, random);
  for (const PoseGraphStart start : kComputed) {
    CHECK(largest_error(start_poses(test.graph, start), test.truth) < 1e-9);
  }
}

TEST_CASE("the given start is the given poses") {
  Random random(2);
  TestPoseGraph test = grid_pose_graph({3, 3, 1}, {}, random);
  scatter(test.graph, random);
  const std::vector<Rigid3d> poses = start_poses(test.graph, PoseGraphStart::kGiven);
  REQUIRE(poses.size() == test.graph.frames.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    CHECK(poses[i].params == test.graph.frames[i].cam_from_world.params);
  }
}

TEST_CASE("fixed frames keep their poses and hold the others") {
  Random random(3);
  TestPoseGraph test = grid_pose_graph({4, 4, 1}, {}, random);
  const Rigid3d moved = random.rigid(2, 1);  // the world as the fixed frames know it
  for (Rigid3d& pose : test.truth) pose = pose * moved;
  scatter(test.graph, random);
  for (GraphFrame& frame : test.graph.frames) frame.fixed = false;
  for (const std::size_t i : {5u, 10u}) {
    test.graph.frames[i].fixed = true;
    test.graph.frames[i].cam_from_world = test.truth[i];
  }
  for (const PoseGraphStart start : kComputed) {
    const std::vector<Rigid3d> poses = start_poses(test.graph, start);
    CHECK(poses[5].params == test.graph.frames[5].cam_from_world.params);
    CHECK(poses[10].params == test.graph.frames[10].cam_from_world.params);
    CHECK(largest_error(poses, test.truth) < 1e-9);
  }
}

TEST_CASE("each part without a fixed frame is held by its first one") {
  Random random(4);
  TestPoseGraph left = grid_pose_graph({3, 2, 1}, {}, random);
  TestPoseGraph right = grid_pose_graph({2, 4, 1}, {}, random);
  scatter(left.graph, random);
  scatter(right.graph, random);
  FactorGraph both = left.graph;
  const auto offset = static_cast<std::uint32_t>(both.frames.size());
  both.frames.insert(both.frames.end(), right.graph.frames.begin(), right.graph.frames.end());
  for (GraphEdge edge : right.graph.edges) {
    edge.a += offset;
    edge.b += offset;
    both.edges.push_back(edge);
  }
  both.frames.emplace_back().cam_from_world = random.rigid(1, 1);  // without edges
  for (GraphFrame& frame : both.frames) frame.fixed = false;

  std::vector<Rigid3d> expected;  // the truth, moved to the given pose of the first frame
  for (const TestPoseGraph* part : {&left, &right}) {
    const Rigid3d move = inverse(part->truth[0]) * part->graph.frames[0].cam_from_world;
    for (const Rigid3d& pose : part->truth) expected.push_back(pose * move);
  }
  expected.push_back(both.frames.back().cam_from_world);
  for (const PoseGraphStart start : kComputed) {
    CHECK(largest_error(start_poses(both, start), expected) < 1e-9);
  }
}

TEST_CASE("on a noisy ring the relaxation spreads the error that the tree leaves at one edge") {
  Random random(5);
  const TestPoseGraph test = ring_pose_graph(60, {0.01, 0.005}, random);
  const auto objective = [&](PoseGraphStart start) {
    return isotropic_objective(moved_to(test.graph, start_poses(test.graph, start)));
  };
  const double tree = objective(PoseGraphStart::kTree);
  const double rotations = objective(PoseGraphStart::kRotations);
  CHECK(rotations < 0.2 * tree);
  CHECK(largest_error(start_poses(test.graph, PoseGraphStart::kRotations), test.truth) < 0.4);
}

TEST_CASE("a noisy grid: the relaxation ends close to its optimum from any given poses") {
  Random random(6);
  TestPoseGraph test = grid_pose_graph({6, 6, 3}, {0.05, 0.1}, random);
  scatter(test.graph, random);
  const FactorGraph start =
      moved_to(test.graph, start_poses(test.graph, PoseGraphStart::kRotations));
  const double at_truth = isotropic_objective(moved_to(test.graph, test.truth));
  CHECK(isotropic_objective(start) < at_truth);
}

TEST_CASE("the tree takes the certain edges, and the relaxation weighs them") {
  Random random(7);
  TestPoseGraph test = grid_pose_graph({5, 5, 1}, {}, random);
  for (std::size_t e = 0; e < test.graph.edges.size(); e += 7) {  // wrong, and says so
    GraphEdge& edge = test.graph.edges[e];
    edge.a_from_b = edge.a_from_b * random.rigid(1, 1);
    edge.information *= 1e-12;
  }
  CHECK(largest_error(start_poses(test.graph, PoseGraphStart::kTree), test.truth) < 1e-9);
  CHECK(largest_error(start_poses(test.graph, PoseGraphStart::kRotations), test.truth) < 1e-6);
}

TEST_CASE("the isotropic objective of anisotropic information") {
  Matrix6d information = Matrix6d::Zero();
  information.diagonal() << 1, 2, 4, 10, 20, 40;
  const IsotropicWeights weights = isotropic_weights(information);
  CHECK(weights.translation == Approx(3 / (1 + 0.5 + 0.25)));
  CHECK(weights.rotation == Approx(3 / (2 * (0.1 + 0.05 + 0.025))));

  FactorGraph graph;
  graph.frames.resize(2);
  const Eigen::Vector3d t(0.3, -0.2, 0.1);
  const double angle = 0.4;
  graph.frames[1].cam_from_world =
      inverse(Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(angle, t.normalized())), t));
  graph.edges.push_back({.a = 0, .b = 1, .a_from_b = {}, .information = information});
  const double chord2 = 8 * std::pow(std::sin(angle / 2), 2);  // |R - I|_F^2
  CHECK(isotropic_objective(graph) ==
        Approx(weights.rotation * chord2 + weights.translation * t.squaredNorm()));
}

}  // namespace
}  // namespace hybrid_slam
