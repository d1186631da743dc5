#include "factors/manifolds.h"

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/sim3d.h"
#include "test/support/jacobian_check.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

Eigen::VectorXd plus(const ceres::Manifold& m, const Eigen::VectorXd& x, const Eigen::VectorXd& d) {
  Eigen::VectorXd result(m.AmbientSize());
  REQUIRE(m.Plus(x.data(), d.data(), result.data()));
  return result;
}

Eigen::VectorXd minus(const ceres::Manifold& m, const Eigen::VectorXd& y,
                      const Eigen::VectorXd& x) {
  Eigen::VectorXd result(m.TangentSize());
  REQUIRE(m.Minus(y.data(), x.data(), result.data()));
  return result;
}

void check_invariants(const ceres::Manifold& m, const Eigen::VectorXd& x,
                      const Eigen::VectorXd& delta) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(m.TangentSize());
  CHECK((plus(m, x, zero) - x).norm() < 1e-14);
  CHECK(minus(m, x, x).norm() < 1e-14);
  const Eigen::VectorXd y = plus(m, x, delta);
  CHECK(std::abs(y.head<4>().norm() - 1) < 1e-14);
  CHECK((minus(m, y, x) - delta).norm() < 1e-11);
  CHECK((plus(m, x, minus(m, y, x)) - y).norm() < 1e-11);

  // Both Jacobians are the lift between tangent and padded tangent.
  RowMajorMatrix plus_jacobian(m.AmbientSize(), m.TangentSize());
  RowMajorMatrix minus_jacobian(m.TangentSize(), m.AmbientSize());
  REQUIRE(m.PlusJacobian(x.data(), plus_jacobian.data()));
  REQUIRE(m.MinusJacobian(x.data(), minus_jacobian.data()));
  const RowMajorMatrix identity = RowMajorMatrix::Identity(m.TangentSize(), m.TangentSize());
  CHECK(minus_jacobian * plus_jacobian == identity);
  CHECK(plus_jacobian.topRows(m.TangentSize()) == identity);

  // The tangent that Plus moves along is the one that Minus measures.
  const auto there_and_back = [&](const Eigen::VectorXd& d) { return minus(m, plus(m, x, d), x); };
  CHECK(jacobian_mismatch(identity, numeric_jacobian(there_and_back, zero)) < 1e-10);
}

}  // namespace

TEST_CASE("PoseManifold: invariants, and Plus perturbs on the left") {
  Random random(31);
  const PoseManifold manifold;
  for (const double angle : {0.0, 1e-9, 1e-3, 1.0, 3.1}) {
    const Rigid3d pose = random.rigid(3, 3.1);
    Vector6d delta;
    delta << random.vector(3, 1), angle * random.direction();
    check_invariants(manifold, pose.params, delta);
    const Eigen::VectorXd moved = plus(manifold, pose.params, delta);
    CHECK((moved - (se3_exp(delta) * pose).params).norm() < 1e-14);
  }
}

TEST_CASE("Sim3Manifold: invariants, and Plus perturbs on the left") {
  Random random(32);
  const Sim3Manifold manifold;
  for (const double angle : {0.0, 1e-9, 1e-3, 1.0, 3.1}) {
    const Rigid3d pose = random.rigid(3, 3.1);
    const Sim3d similarity(pose.rotation(), pose.translation(), random.uniform(0.3, 3));
    Vector7d delta;
    delta << random.vector(3, 1), angle * random.direction(), random.uniform(-1, 1);
    check_invariants(manifold, similarity.params, delta);
    const Eigen::VectorXd moved = plus(manifold, similarity.params, delta);
    CHECK((moved - (sim3_exp(delta) * similarity).params).norm() < 1e-14);
  }
}

}  // namespace hybrid_slam
