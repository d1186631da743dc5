#include "backend/incremental/chart.h"
#include "test/support/jacobian_check.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// Where `base` and `delta` take a few points: smooth, and tells every motion from every other.
Eigen::Matrix<double, 9, 1> moved_points(const Rigid3d& cam_from_world) {
  Eigen::Matrix<double, 9, 1> result;
  result << cam_from_world * Eigen::Vector3d(1, 0, 2), cam_from_world * Eigen::Vector3d(0, 3, 1),
      cam_from_world * Eigen::Vector3d(-2, 1, 0);
  return result;
}

TEST_CASE("chart: derivatives by the chart are those of the pose") {
  Random random(1);
  for (const double size : {0., 1e-6, 0.1, 1.}) {
    for (int trial = 0; trial < 20; ++trial) {
      const Rigid3d base = random.rigid(5, 3);
      Vector6d delta = random.vector(6, 1);
      delta *= size / delta.tail<3>().norm();

      const auto at_left = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        return moved_points(se3_exp(Vector6d(d)) * chart_pose(base, delta));
      };
      const Eigen::Matrix<double, 9, 6> by_left =
          numeric_jacobian(at_left, Eigen::VectorXd::Zero(6));
      const auto at_chart = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        return moved_points(chart_pose(base, Vector6d(d)));
      };
      CHECK(jacobian_mismatch(by_chart<9>(by_left, base, delta),
                              numeric_jacobian(at_chart, delta)) < 1e-8);
    }
  }
}

TEST_CASE("chart: poses that one rigid motion moves have equal deltas") {
  Random random(2);
  const Rigid3d world_from_new_world = random.rigid(2, 1);
  const Vector6d delta = se3_log(world_from_new_world);
  for (int trial = 0; trial < 20; ++trial) {
    const Rigid3d base = random.rigid(10, 3);
    const Vector6d difference =
        se3_log(inverse(chart_pose(base, delta)) * (base * world_from_new_world));
    CHECK(difference.norm() < 1e-12);
  }
}

}  // namespace
}  // namespace hybrid_slam
