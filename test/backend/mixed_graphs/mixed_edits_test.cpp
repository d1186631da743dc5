#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include <ceres/manifold.h>
#include <ceres/sphere_manifold.h>

#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/mixed_graphs/inertial_chain.h"
#include "test/backend/mixed_graphs/test_factors.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

IncrementalOptions patient() {
  IncrementalOptions options;
  options.relinearization = 1e-10;
  options.worst_mismatch = 1e-5;
  options.wildfire = 1e-11;
  options.block_wildfire = 1e-8;
  options.budget = 1e12;
  return options;
}

void settle(IncrementalSolver& solver) {
  for (int i = 0; i < 8; ++i) solver.update();
}

InertialChain small_chain(int poses = 25) {
  InertialChainOptions options;
  options.poses = poses;
  options.ranges = 3;
  return inertial_chain(options);
}

// Feeds a whole chain; its beacons have the indices 0, 1, 2 in the solver, blocks of poses follow.
void feed_all(MixedFeed& feed) {
  while (!feed.done()) feed.feed_next();
  settle(feed.solver());
}

// The message of the std::logic_error that a call throws; empty if it throws none.
std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::logic_error& error) {
    return error.what();
  }
  return {};
}

TEST_CASE("mixed edits: bad use is refused with the index and the reason, and changes nothing") {
  MixedFeed feed(small_chain().graph, {});
  feed_all(feed);
  IncrementalSolver& solver = feed.solver();
  const std::uint32_t gone = solver.add_block({Eigen::Vector3d(1, 2, 3)});
  solver.remove_block(gone);
  solver.update();
  const FactorGraph before = solver.graph();
  const auto range = range_factor(2, 0.1);

  const auto add = [&](const GraphFactor& factor) {
    return refusal([&] { solver.add_factor(factor); });
  };
  CHECK(add({nullptr, {}}).find("has no function") != std::string::npos);
  CHECK(add({range, {pose_variable(3), block_variable(777)}}).find("block 777 is not there") !=
        std::string::npos);
  CHECK(add({range, {pose_variable(99), block_variable(0)}}).find("pose 99 is not there") !=
        std::string::npos);
  CHECK(add({range, {pose_variable(3), block_variable(gone)}})
            .find("block " + std::to_string(gone) + " was removed") != std::string::npos);
  CHECK(add({range, {pose_variable(3), point_variable(0)}}).find("point 0 is not there") !=
        std::string::npos);
  CHECK(add({range, {pose_variable(3), block_variable(4)}}).find("block 4 has 9 numbers") !=
        std::string::npos);
  CHECK(add({range, {pose_variable(3)}}).find("is of 2 variables, not 1") != std::string::npos);
  CHECK(
      add({range_factor(kNaN, 0.1), {pose_variable(3), block_variable(0)}}).find("not a number") !=
      std::string::npos);
  GraphFactor twice{value_factor<9>(Eigen::Matrix<double, 9, 1>::Zero(), 1), {block_variable(3)}};
  twice.threshold = 0;
  CHECK(add(twice).find("threshold") != std::string::npos);

  GraphBlock block;
  CHECK(refusal([&] { solver.add_block(block); }).find("has no values") != std::string::npos);
  block.values = Eigen::Vector3d(1, kNaN, 0);
  CHECK(refusal([&] { solver.add_block(block); }).find("not finite") != std::string::npos);
  block.values = Eigen::Vector3d(1, 0, 0);
  block.world_vectors = {0};
  CHECK(refusal([&] { solver.add_block(block); }).find("no frame") != std::string::npos);
  block.rides_with = 444;
  CHECK(refusal([&] { solver.add_block(block); }).find("pose 444") != std::string::npos);
  block.rides_with = 2;
  block.world_vectors = {1};
  CHECK(refusal([&] { solver.add_block(block); }).find("world_vectors") != std::string::npos);
  block.world_vectors = {};
  block.manifold = std::make_shared<ceres::SphereManifold<4>>();
  CHECK(refusal([&] { solver.add_block(block); }).find("manifold") != std::string::npos);
  CHECK(refusal([&] { solver.remove_block(555); }).find("block 555") != std::string::npos);
  CHECK(refusal([&] { solver.remove_factor(5555); }).find("factor 5555") != std::string::npos);
  CHECK(refusal([&] { solver.set_fixed(block_variable(gone), true); }).find("removed") !=
        std::string::npos);
  CHECK(refusal([&] { solver.marginalize({point_variable(0)}); }) != "");

  CHECK(solver.update().steps == 0);
  const FactorGraph after = solver.graph();
  CHECK(after.factors.size() == before.factors.size());
  CHECK(after.blocks.size() == before.blocks.size());
  CHECK(cost(after) == cost(before));

  FactorGraph graph = before;
  graph.factors.push_back({range, {pose_variable(3), block_variable(777)}});
  CHECK(graph.validate() ==
        "factor " + std::to_string(before.factors.size()) + ": block 777 is not there");
}

TEST_CASE("mixed edits: after each, the optimum of what is there") {
  MixedFeed feed(small_chain().graph, patient());
  feed_all(feed);
  IncrementalSolver& solver = feed.solver();
  const auto check = [&] {
    settle(solver);
    CHECK(std::abs(excess(solver)) < 1e-6);
  };
  check();
  SECTION("factors go and come") {
    const double before = cost(solver.graph());
    const GraphFactor taken = solver.graph().factors.back();
    Random random(2);
    for (int i = 0; i < 6; ++i) {
      solver.remove_factor(static_cast<std::uint32_t>(10 + random.below(20)));
    }
    check();
    CHECK(cost(solver.graph()) < before);
    const std::uint32_t added = solver.add_factor(taken);
    CHECK(added < 30);  // an index that was free
    check();
  }
  SECTION("a block goes with its factors") {
    const std::size_t before = solver.graph().factors.size();
    solver.remove_block(1);
    check();
    CHECK(solver.graph().factors.size() < before - 5);
    CHECK_THROWS_AS(solver.block(1), std::logic_error);
    CHECK(solver.add_block({Eigen::Vector3d(1, 2, 3)}) == 1);
    solver.add_factor({range_factor(3, 0.1), {pose_variable(4), block_variable(1)}});
    solver.add_factor({value_factor<3>({1, 2, 3}, 0.5), {block_variable(1)}});
    check();
  }
  SECTION("blocks and poses are fixed, and let go again") {
    const double before = cost(solver.graph());
    for (const GraphVariable variable : {block_variable(0), block_variable(9), pose_variable(12)}) {
      solver.set_fixed(variable, true);
      check();
      // Elsewhere it would be cheaper now: something pulls.
      solver.add_factor({range_factor(7, 0.05), {pose_variable(12), block_variable(0)}});
      check();
      CHECK(solver.graph().blocks[0].fixed == (variable == block_variable(0)));
      solver.set_fixed(variable, false);
      check();
    }
    CHECK(cost(solver.graph()) > before);
  }
  SECTION("a block is held by a factor of its own") {
    const Eigen::Vector3d place = solver.block(2);
    const Eigen::Vector3d elsewhere = place + Eigen::Vector3d(1, 0, 0);
    const std::uint32_t hold =
        solver.add_factor({value_factor<3>(elsewhere, 1e-4), {block_variable(2)}});
    check();
    CHECK((solver.block(2) - elsewhere).norm() < 0.05);
    solver.remove_factor(hold);
    check();
    CHECK((solver.block(2) - place).norm() < 1e-4);
  }
}

TEST_CASE("mixed edits: what is marginalised stays in the optimum of the others") {
  MixedFeed feed(small_chain(20).graph, patient());
  feed_all(feed);
  IncrementalSolver& solver = feed.solver();
  const Rigid3d pose = solver.pose(19);
  const Matrix6d spread = solver.covariance(19);
  const Eigen::VectorXd beacon = solver.block(2);
  // A beacon, a block that rides, a pose with its block.
  solver.marginalize({block_variable(0), block_variable(3 + 5)});
  settle(solver);
  solver.marginalize({pose_variable(7)});
  settle(solver);
  CHECK(solver.graph().priors.size() >= 1);
  CHECK(se3_log(solver.pose(19) * inverse(pose)).norm() < 1e-5);
  CHECK((solver.block(2) - beacon).norm() < 1e-5);
  CHECK((solver.covariance(19) - spread).norm() < 1e-3 * spread.norm());
  CHECK(std::abs(excess(solver)) < 1e-6);
  CHECK_THROWS_AS(solver.set_fixed(pose_variable(7), false), std::logic_error);
  // What comes now is weighed against the prior.
  GraphFactor factor{range_factor(4, 0.1), {pose_variable(8), block_variable(2)}};
  solver.add_factor(factor);
  settle(solver);
  CHECK(std::abs(excess(solver)) < 1e-3);
}

TEST_CASE("mixed edits: a window over a chain with blocks is bounded, and near the whole") {
  InertialChainOptions way;
  way.poses = 80;
  way.loops = false;
  const InertialChain chain = inertial_chain(way);
  IncrementalOptions options;
  MixedFeed all(chain.graph, options);
  options.window = 10;
  MixedFeed window(chain.graph, options);
  double worst = 0;
  while (!all.done()) {
    all.feed_next();
    window.feed_next();
    const auto newest = static_cast<std::uint32_t>(all.solver().pose_count() - 1);
    const Vector6d error =
        se3_log(window.solver().pose(newest) * inverse(all.solver().pose(newest)));
    const Matrix6d spread = all.solver().covariance(newest);
    worst = std::max(worst, squared_mahalanobis(error, spread));
  }
  const FactorGraph graph = window.solver().graph();
  int varying = 0;
  for (const GraphBlock& block : graph.blocks) varying += block.fixed ? 0 : 1;
  CHECK(varying <= 11);
  CHECK(graph.factors.size() < 20);
  CHECK(worst < 1);  // of 6 degrees of freedom
}

}  // namespace
}  // namespace hybrid_slam
