#include <array>
#include <cstdio>
#include <vector>

#include <Eigen/Cholesky>

#include "cameras/geometry/se3.h"
#include "factors/pose_prior.h"
#include "test/backend/mixed_graphs/inertial_chain.h"
#include "test/backend/mixed_graphs/test_factors.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

double nees_per_dof(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
  return error.dot(covariance.llt().solve(error)) / static_cast<double>(error.size());
}

constexpr std::uint32_t kPoses = 60;

struct Nees {
  double pose = 0;
  double block = 0;
  double velocity = 0;
};

// Of the newest pose and its block.
Nees nees_of(const InertialChain& chain, const IncrementalSolver& solver, std::uint32_t last) {
  Nees nees;
  // The covariance is of exp(d) * cam_from_world.
  const Vector6d error = se3_log(chain.truth[last] * inverse(solver.pose(last)));
  nees.pose = nees_per_dof(error, solver.covariance(last));
  const Eigen::VectorXd block_error = chain.true_blocks[last] - solver.block(last);
  const Eigen::MatrixXd covariance = solver.covariance({block_variable(last)});
  nees.block = nees_per_dof(block_error, covariance);
  nees.velocity = nees_per_dof(block_error.head<3>(), covariance.topLeftCorner<3, 3>());
  return nees;
}

// One run: a chain whose measurements, priors and random walk of biases all have the noise that
// they are weighed by, fed step by step; at a third of the way, at two thirds and at the end.
// Without loops where there is a window: to a pose that left it, they would count it as known.
std::array<Nees, 3> run(InertialChainOptions options, const IncrementalOptions& solver_options) {
  options.poses = kPoses;
  options.consistent = true;
  options.loops = solver_options.window == 0;
  const InertialChain chain = inertial_chain(options);
  MixedFeed feed(chain.graph, solver_options);
  std::array<Nees, 3> nees;
  while (!feed.done()) {
    feed.feed_next();
    if (feed.count() % (kPoses / 3) != 0) continue;
    nees[feed.count() / (kPoses / 3) - 1] = nees_of(chain, feed.solver(), feed.count() - 1);
  }
  const bool condenses = options.landmarks > 0 && solver_options.condense_after > 0;
  CHECK(condenses == (feed.solver().condensed_count() > 20));
  return nees;
}

// 100 runs, one value each at each of three times: the mean of chi2 of 6 or 9 degrees of freedom,
// per degree, has a standard deviation of 0.058 or 0.047, so the bounds are three of the former,
// and more.
void check_consistent(const IncrementalOptions& solver, InertialChainOptions chain = {}) {
  constexpr int kRuns = 100;
  std::array<Nees, 3> mean;
  for (int i = 0; i < kRuns; ++i) {
    chain.seed = static_cast<std::uint64_t>(100 + i);
    const std::array<Nees, 3> nees = run(chain, solver);
    for (std::size_t k = 0; k < nees.size(); ++k) {
      mean[k].pose += nees[k].pose / kRuns;
      mean[k].block += nees[k].block / kRuns;
      mean[k].velocity += nees[k].velocity / kRuns;
    }
  }
  for (const Nees& at : mean) {
    std::printf("mean NEES per degree of freedom: pose %.3f, block %.3f, velocity %.3f\n", at.pose,
                at.block, at.velocity);
    for (const double value : {at.pose, at.block, at.velocity}) {
      CHECK(value > 0.8);
      CHECK(value < 1.3);
    }
  }
}

TEST_CASE("mixed graphs: errors are those that the covariances tell", "[slow]") {
  IncrementalOptions options;
  SECTION("the whole graph") { check_consistent(options); }
  SECTION("with a window") {
    options.window = 20;
    check_consistent(options);
  }
  SECTION("landmarks that are seen on every lap, condensed or not") {
    InertialChainOptions chain;
    chain.landmarks = 4;
    options.condense_after = GENERATE(0, 8);
    check_consistent(options, chain);
  }
}

}  // namespace
}  // namespace hybrid_slam
