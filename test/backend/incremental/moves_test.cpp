// Estimates that others move: loops, adjustments of everything.
#include <limits>

#include <catch2/catch.hpp>

#include "backend/incremental/incremental_solver.h"
#include "cameras/geometry/se3.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

using Moves = std::vector<std::pair<std::uint32_t, Rigid3d>>;

// A fixed pose and a chain that begins there, with edges that do not quite agree.
struct MovedChain {
  explicit MovedChain(const IncrementalOptions& options) : solver(options) {
    Random random(1);
    Matrix6d information = Matrix6d::Identity() * 1e4;
    information(0, 4) = information(4, 0) = 2e3;
    Rigid3d pose;
    for (std::uint32_t i = 0; i < kPoses; ++i) {
      const Rigid3d step = random.rigid(1, 0.5);
      if (i > 0) pose = step * pose;
      solver.add_pose({pose, GraphFrame::kNoCamera, i == 0});
      truth.push_back(pose);
      for (std::uint32_t back = 1; back <= 2 && back <= i; ++back) {
        if (i - back == 0 && back == 2) continue;  // the first edge alone holds the chain
        const Rigid3d motion = pose * inverse(truth[i - back]);
        solver.add_edge({i, i - back, se3_exp(random.vector(6, 0.01)) * motion, information});
      }
    }
    for (int i = 0; i < 5; ++i) solver.update();
    for (std::uint32_t i = 0; i < kPoses; ++i) settled.push_back(solver.pose(i));
  }

  double off() const {
    double worst = 0;
    for (std::uint32_t i = 0; i < kPoses; ++i) {
      worst = std::max(worst, (solver.pose(i).params - settled[i].params).norm());
    }
    return worst;
  }

  static constexpr std::uint32_t kPoses = 12;
  IncrementalSolver solver;
  std::vector<Rigid3d> truth;
  std::vector<Rigid3d> settled;
};

// All but the fixed one, as one rigid body.
Moves moved_together(const MovedChain& chain, const Rigid3d& by) {
  Moves moves;
  for (std::uint32_t i = 1; i < MovedChain::kPoses; ++i) {
    moves.emplace_back(i, chain.settled[i] * inverse(by));
  }
  return moves;
}

TEST_CASE("Poses that are moved are where they were moved to, and their terms decide what stays") {
  IncrementalOptions options;
  options.relinearization = 1e-10;  // to the end
  MovedChain chain(options);
  const Rigid3d by(so3_exp(Eigen::Vector3d(0.2, -0.1, 0.3)), Eigen::Vector3d(0.5, -0.2, 0.4));
  const Moves moves = moved_together(chain, by);
  chain.solver.move_poses(moves);
  for (const auto& [pose, to] : moves) {
    CHECK((chain.solver.pose(pose).params - to.params).norm() < 1e-12);
  }
  for (int i = 0; i < 10; ++i) chain.solver.update();
  CHECK(chain.off() < 1e-5);
}

TEST_CASE("A pose that is moved by next to nothing, and wrongly, goes back at the next update") {
  MovedChain chain(IncrementalOptions{});
  chain.solver.move_poses(
      {{5, Rigid3d(Eigen::Quaterniond::Identity(), {1e-3, 0, 0}) * chain.settled[5]}});
  CHECK(chain.off() > 0.5e-3);
  chain.solver.update();
  CHECK(chain.off() < 1e-5);
}

TEST_CASE("Terms between poses that moved as one rigid body are not linearised anew") {
  IncrementalOptions options;
  options.max_steps = 1;
  MovedChain chain(options);
  chain.solver.move_poses(moved_together(
      chain, Rigid3d(so3_exp(Eigen::Vector3d(0.3, 0, 0.2)), Eigen::Vector3d(1, 2, 3))));
  CHECK(chain.solver.update().relinearized == 1);  // the edge that holds the chain
}

TEST_CASE("Poses that cannot be moved are refused, and none is") {
  MovedChain chain(IncrementalOptions{});
  const Rigid3d elsewhere = se3_exp(Vector6d::Constant(0.1));
  Rigid3d not_finite;
  not_finite.params[4] = std::numeric_limits<double>::quiet_NaN();
  for (const auto& wrong :
       {std::pair(0U, elsewhere), std::pair(99U, elsewhere), std::pair(2U, not_finite)}) {
    CHECK_THROWS_AS(chain.solver.move_poses({{1, elsewhere}, wrong}), std::logic_error);
  }
  CHECK(chain.off() == 0);
}

}  // namespace
}  // namespace hybrid_slam
