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

struct Nees {
  double pose = 0;
  double block = 0;
  double velocity = 0;
};

// One run: a chain whose measurements, priors and random walk of biases all have the noise that
// they are weighed by, fed step by step. Of the newest pose and its block at the end.
// Without loops where there is a window: to a pose that left it, they would count it as known.
Nees run(std::uint64_t seed, const IncrementalOptions& solver_options) {
  InertialChainOptions options;
  options.poses = 60;
  options.seed = seed;
  options.consistent = true;
  options.loops = solver_options.window == 0;
  const InertialChain chain = inertial_chain(options);
  MixedFeed feed(chain.graph, solver_options);
  while (!feed.done()) feed.feed_next();
  const IncrementalSolver& solver = feed.solver();
  const std::uint32_t last = 59;
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

// 100 runs, one value each: the mean of chi2 of 6 or 9 degrees of freedom, per degree, has a
// standard deviation of 0.058 or 0.047, so the bounds are three of the former, and more.
void check_consistent(const IncrementalOptions& options) {
  constexpr int kRuns = 100;
  Nees mean;
  for (int i = 0; i < kRuns; ++i) {
    const Nees nees = run(static_cast<std::uint64_t>(100 + i), options);
    mean.pose += nees.pose / kRuns;
    mean.block += nees.block / kRuns;
    mean.velocity += nees.velocity / kRuns;
  }
  std::printf("mean NEES per degree of freedom: pose %.3f, block %.3f, velocity %.3f\n", mean.pose,
              mean.block, mean.velocity);
  for (const double value : {mean.pose, mean.block, mean.velocity}) {
    CHECK(value > 0.8);
    CHECK(value < 1.3);
  }
}

TEST_CASE("mixed graphs: errors are those that the covariances tell", "[slow]") {
  IncrementalOptions options;
  SECTION("the whole graph") { check_consistent(options); }
  SECTION("with a window") {
    options.window = 20;
    check_consistent(options);
  }
}

}  // namespace
}  // namespace hybrid_slam
