#include <numbers>

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/sim3d.h"
#include "cameras/geometry/uncertain_motion.h"
#include "test/support/jacobian_check.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

constexpr double kPi = std::numbers::pi;

// Angles at which series give way to closed forms, and the ends of the range.
const double kAngles[] = {0,   1e-12, 1e-9,  1e-5, 0.9999e-4, 1.0001e-4,  0.0999,     0.1001,
                          0.5, 0.999, 1.001, 2,    3,         kPi - 1e-4, kPi - 1e-9, kPi - 1e-12};

Eigen::Matrix4d matrix(const Rigid3d& t) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = t.rotation().toRotationMatrix();
  m.topRightCorner<3, 1>() = t.translation();
  return m;
}

Eigen::Matrix4d matrix(const Sim3d& s) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = s.scale() * s.rotation().toRotationMatrix();
  m.topRightCorner<3, 1>() = s.translation();
  return m;
}

// The exponential of a 4x4 matrix by scaling, Taylor series and squaring: independent of the code.
Eigen::Matrix4d matrix_exp(const Eigen::Matrix4d& generator) {
  const Eigen::Matrix4d a = generator / 64;
  Eigen::Matrix4d sum = Eigen::Matrix4d::Identity();
  Eigen::Matrix4d term = sum;
  for (int i = 1; i < 25; ++i) {
    term = term * a / i;
    sum += term;
  }
  for (int i = 0; i < 6; ++i) sum = sum * sum;
  return sum;
}

Eigen::Matrix4d generator(const Vector7d& tangent) {
  Eigen::Matrix4d g = Eigen::Matrix4d::Zero();
  g.topLeftCorner<3, 3>() = hat(tangent.segment<3>(3)) + tangent[6] * Eigen::Matrix3d::Identity();
  g.topRightCorner<3, 1>() = tangent.head<3>();
  return g;
}

}  // namespace

TEST_CASE("Rotations: log inverts exp from zero to pi") {
  Random random(1);
  for (const double angle : kAngles) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d omega = angle * random.direction();
      const Eigen::Quaterniond q = so3_exp(omega);
      CHECK(std::abs(q.norm() - 1) < 1e-15);
      CHECK((so3_log(q) - omega).norm() <= 1e-14 * (1 + angle));
      const Eigen::Quaterniond negative(-q.coeffs());
      CHECK((so3_log(negative) - omega).norm() <= 1e-14 * (1 + angle));
    }
  }
}

TEST_CASE("Rotations: at exactly pi the log is one of the two vectors") {
  const Eigen::Vector3d axis(0.6, 0, 0.8);
  const Eigen::Vector3d omega = so3_log(Eigen::Quaterniond(0, axis[0], axis[1], axis[2]));
  CHECK(std::abs(omega.norm() - kPi) < 1e-15);
  CHECK(omega.cross(axis).norm() < 1e-15);
}

TEST_CASE("SE3 and Sim3: exp is the matrix exponential") {
  Random random(2);
  for (const double angle : kAngles) {
    for (const double log_scale : {0.0, 1e-9, -1e-3, 0.3, -1.5, 3.0}) {
      Vector7d tangent;
      tangent << random.vector(3, 5), angle * random.direction(), log_scale;
      const Eigen::Matrix4d expected = matrix_exp(generator(tangent));
      CHECK((matrix(sim3_exp(tangent)) - expected).norm() < 1e-13 * expected.norm());
      if (log_scale == 0) {
        CHECK((matrix(se3_exp(tangent.head<6>())) - expected).norm() < 1e-13 * expected.norm());
      }
    }
  }
}

TEST_CASE("SE3 and Sim3: log inverts exp from zero to pi") {
  Random random(3);
  for (const double angle : kAngles) {
    for (const double log_scale : {0.0, 1e-9, -1e-3, 0.3, -1.5}) {
      Vector7d tangent;
      tangent << random.vector(3, 5), angle * random.direction(), log_scale;
      CHECK((sim3_log(sim3_exp(tangent)) - tangent).norm() < 1e-12);
      CHECK((se3_log(se3_exp(tangent.head<6>())) - tangent.head<6>()).norm() < 1e-12);
    }
  }
}

TEST_CASE("Transforms compose and invert as their matrices do") {
  Random random(4);
  for (int i = 0; i < 50; ++i) {
    const Rigid3d a = random.rigid(3, kPi);
    const Rigid3d b = random.rigid(3, kPi);
    const Eigen::Vector3d p = random.vector(3, 4);
    CHECK((matrix(a * b) - matrix(a) * matrix(b)).norm() < 1e-13);
    CHECK((matrix(inverse(a)) * matrix(a) - Eigen::Matrix4d::Identity()).norm() < 1e-13);
    CHECK((a * p - (matrix(a) * p.homogeneous()).hnormalized()).norm() < 1e-13);
    CHECK((a * origin_in_a(a)).norm() < 1e-13);

    const Sim3d s(a.rotation(), a.translation(), random.uniform(0.2, 4));
    const Sim3d t(b.rotation(), b.translation(), random.uniform(0.2, 4));
    CHECK((matrix(s * t) - matrix(s) * matrix(t)).norm() < 1e-12);
    CHECK((matrix(inverse(s)) * matrix(s) - Eigen::Matrix4d::Identity()).norm() < 1e-12);
    CHECK((s * p - (matrix(s) * p.homogeneous()).hnormalized()).norm() < 1e-12);
    CHECK((without_scale(s) * p - (s * p) / s.scale()).norm() < 1e-12);
  }
}

TEST_CASE("Left Jacobians against numeric differences, from zero to pi") {
  Random random(5);
  for (const double angle : kAngles) {
    Vector6d tangent;
    tangent << random.vector(3, 3), angle * random.direction();
    const Eigen::Vector3d omega = tangent.tail<3>();

    const auto so3_step = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return so3_log(so3_exp(omega + d) * so3_exp(omega).conjugate());
    };
    CHECK(jacobian_mismatch(so3_left_jacobian(omega),
                            numeric_jacobian(so3_step, Eigen::Vector3d::Zero())) < 1e-10);
    CHECK(
        (so3_left_jacobian(omega) * so3_left_jacobian_inverse(omega) - Eigen::Matrix3d::Identity())
            .norm() < 1e-12);

    const auto se3_step = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return se3_log(se3_exp(tangent + d) * inverse(se3_exp(tangent)));
    };
    CHECK(jacobian_mismatch(se3_left_jacobian(tangent),
                            numeric_jacobian(se3_step, Vector6d::Zero())) < 1e-10);
    CHECK((se3_left_jacobian(tangent) * se3_left_jacobian_inverse(tangent) - Matrix6d::Identity())
              .norm() < 1e-12);
  }
}

// Against the poses themselves, a step along each of the six axes.
TEST_CASE("Covariances of motions are those of the inverse, and those that ROS has") {
  Random random(11);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 20; ++i) {
    const Rigid3d b_from_a = random.rigid(3, kPi);
    const Rigid3d a_from_b = inverse(b_from_a);
    Matrix6d by_inverse, in_ros;
    for (int k = 0; k < 6; ++k) {
      const Rigid3d moved = se3_exp(kStep * Vector6d::Unit(k)) * b_from_a;
      by_inverse.col(k) = se3_log(inverse(moved) * b_from_a) / kStep;
      in_ros.col(k) << moved.translation() - b_from_a.translation(),
          so3_log(moved.rotation() * b_from_a.rotation().conjugate());
      in_ros.col(k) /= kStep;
    }
    Matrix6d root;
    for (double& x : root.reshaped()) x = random.uniform(-1, 1);
    const UncertainMotion motion{b_from_a, root * root.transpose()};
    CHECK(inverse(motion).b_from_a.params == a_from_b.params);
    CHECK((inverse(motion).covariance - by_inverse * motion.covariance * by_inverse.transpose())
              .norm() < 1e-3);
    CHECK((ros_covariance(motion) - in_ros * motion.covariance * in_ros.transpose()).norm() < 1e-3);
    CHECK(ros_covariance(motion) == ros_covariance(motion).transpose());
  }
}

TEST_CASE("Adjoints move a perturbation from the right to the left") {
  Random random(6);
  for (int i = 0; i < 50; ++i) {
    const Rigid3d t = random.rigid(3, kPi);
    const Vector6d d = random.vector(6, 0.5);
    CHECK((matrix(t * se3_exp(d)) - matrix(se3_exp(adjoint(t) * d) * t)).norm() < 1e-12);

    const Sim3d s(t.rotation(), t.translation(), random.uniform(0.3, 3));
    const Vector7d e = random.vector(7, 0.5);
    CHECK((matrix(s * sim3_exp(e)) - matrix(sim3_exp(adjoint(s) * e) * s)).norm() < 1e-11);
  }
}

}  // namespace hybrid_slam
