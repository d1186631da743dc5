#include "frontend/odometry/odometry_chain.h"

#include <catch2/catch.hpp>

#include "test/support/random.h"

namespace hybrid_slam {
namespace {

StereoMotion random_motion(Random& random) {
  StereoMotion motion;
  motion.current_from_previous = random.rigid(0.5, 0.3);
  motion.covariance = Vector6d::Constant(1e-4).asDiagonal();
  motion.covariance(0, 4) = motion.covariance(4, 0) = random.uniform(-5e-5, 5e-5);
  for (const int current : {7, 2, 5}) motion.inliers.push_back({current + 1, current});
  return motion;
}

TEST_CASE("A chain of motions leads from keyframe to keyframe") {
  Random random(1);
  OdometryChain chain;
  chain.begin();
  Rigid3d whole;
  Matrix6d covariance = Matrix6d::Zero();
  for (int i = 0; i < 5; ++i) {
    const StereoMotion motion = random_motion(random);
    chain.add(motion);
    whole = motion.current_from_previous * whole;
    const Matrix6d carry = adjoint(motion.current_from_previous);
    covariance = motion.covariance + carry * covariance * carry.transpose();
  }
  const auto odometry = chain.odometry(KeyframeId(3));
  REQUIRE(odometry != nullptr);
  CHECK(odometry->previous == KeyframeId(3));
  CHECK(odometry->motion.b_from_a.params.isApprox(whole.params, 1e-12));
  CHECK(odometry->motion.covariance.isApprox(covariance, 1e-12));
  CHECK(is_valid(*odometry, 8));
  CHECK(odometry->keypoints == std::vector<std::uint32_t>{2, 5, 7});  // of the last motion
  CHECK(chain.odometry(KeyframeId()) == nullptr);
}

TEST_CASE("A motion that is missing ends the chain until the next keyframe") {
  Random random(2);
  OdometryChain chain;
  chain.add(random_motion(random));
  CHECK(chain.odometry(KeyframeId(0)) == nullptr);  // not begun
  chain.begin();
  CHECK(chain.odometry(KeyframeId(0)) == nullptr);  // no motion yet
  chain.add(random_motion(random));
  chain.add(std::nullopt);
  chain.add(random_motion(random));
  CHECK(chain.odometry(KeyframeId(0)) == nullptr);
  chain.begin();
  chain.add(random_motion(random));
  CHECK(chain.odometry(KeyframeId(1)) != nullptr);
}

// To first order, of which the second is seen to be small.
TEST_CASE("Motions and what they are off by are composed") {
  Random random(3);
  for (int i = 0; i < 20; ++i) {
    const UncertainMotion first{random.rigid(1, 2), Matrix6d::Identity()};
    const UncertainMotion second{random.rigid(1, 2), Matrix6d::Zero()};
    Matrix6d by_first;
    for (int k = 0; k < 6; ++k) {
      const Vector6d d = 1e-6 * Vector6d::Unit(k);
      const Rigid3d off = second.b_from_a * (se3_exp(d) * first.b_from_a) *
                          inverse(second.b_from_a * first.b_from_a);
      by_first.col(k) = se3_log(off) / 1e-6;
    }
    const UncertainMotion both = second * first;
    CHECK((both.covariance - by_first * by_first.transpose()).norm() < 1e-6);
    CHECK(both.covariance == both.covariance.transpose());
  }
}

}  // namespace
}  // namespace hybrid_slam
