#include "backend/incremental/world_tangent.h"

#include "test/support/jacobian_check.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// Where a pose takes a few points: smooth, and tells every motion from every other.
Eigen::Matrix<double, 9, 1> moved_points(const Rigid3d& cam_from_world) {
  Eigen::Matrix<double, 9, 1> result;
  result << cam_from_world * Eigen::Vector3d(1, 0, 2), cam_from_world * Eigen::Vector3d(0, 3, 1),
      cam_from_world * Eigen::Vector3d(-2, 1, 0);
  return result;
}

TEST_CASE("world tangent: derivatives by the increment") {
  Random random(1);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(6);
  for (int trial = 0; trial < 50; ++trial) {
    const Rigid3d pose = random.rigid(5, 3);
    const WorldTangent tangent{random.gaussian3(5)};
    const auto at_left = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return moved_points(se3_exp(Vector6d(d)) * pose);
    };
    const auto at_increment = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return moved_points(tangent.moved(pose, Vector6d(d)));
    };
    const Eigen::Matrix<double, 9, 6> by_left = numeric_jacobian(at_left, zero);
    const Eigen::Matrix<double, 9, 6> by_increment = tangent.from_left(by_left, pose);
    CHECK(jacobian_mismatch(by_increment, numeric_jacobian(at_increment, zero)) < 1e-8);
    CHECK((tangent.from_origin(tangent.to_origin(by_left)) - by_left).norm() < 1e-12);
  }
}

TEST_CASE(
    "world tangent: what poses see of each other and of a point survives a common increment") {
  Random random(2);
  for (int trial = 0; trial < 20; ++trial) {
    // One rigid motion, as seen at two places.
    const Vector6d xi = random.vector(6, 1);
    const WorldTangent of_a{random.gaussian3(10)};
    const WorldTangent of_b{random.gaussian3(10)};
    const Vector6d da = WorldTangent{-of_a.place}.at_origin(xi);
    const Vector6d db = WorldTangent{-of_b.place}.at_origin(xi);
    const Rigid3d a = random.rigid(10, 3);
    const Rigid3d b = random.rigid(10, 3);
    const Rigid3d before = a * inverse(b);
    const Rigid3d after = of_a.moved(a, da) * inverse(of_b.moved(b, db));
    CHECK((before.params - after.params).norm() < 1e-12);

    const Eigen::Vector3d point = random.gaussian3(5);
    const Eigen::Vector3d point_moved = point + of_a.carried(point, 1e-6 * da);
    CHECK((of_a.moved(a, 1e-6 * da) * point_moved - a * point).norm() < 1e-9);
    CHECK((of_b.carried(point, db) - of_a.carried(point, da)).norm() < 1e-12);
  }
}

}  // namespace
}  // namespace hybrid_slam
