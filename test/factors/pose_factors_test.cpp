#include <numbers>

#include <ceres/jet.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "factors/manifolds.h"
#include "factors/point_in_frame.h"
#include "factors/pose_prior.h"
#include "factors/relative_pose_factor.h"
#include "factors/relative_similarity_factor.h"
#include "test/support/factor_check.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

const PoseManifold kPose;
const Sim3Manifold kSim3;

// Positive definite, far from isotropic.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> random_information(Random& random) {
  Eigen::Matrix<double, kSize, kSize> root;
  for (int i = 0; i < kSize; ++i) root.col(i) = random.vector(kSize, 1) * std::pow(3.0, i - 2);
  return root * root.transpose() + 0.1 * Eigen::Matrix<double, kSize, kSize>::Identity();
}

Sim3d random_similarity(Random& random) {
  const Rigid3d rigid = random.rigid(2, 3.1);
  return {rigid.rotation(), rigid.translation(), random.uniform(0.4, 2.5)};
}

// A similarity over jets, for a derivative independent of the factors' own: moved by exp(delta) to
// first order.
template <typename T>
struct JetSim3 {
  Eigen::Quaternion<T> rotation;
  Eigen::Matrix<T, 3, 1> translation;
  T scale;

  JetSim3(const Sim3d& s, int first_jet, bool with_scale)
      : rotation(Eigen::Quaterniond(s.rotation()).cast<T>()),
        translation(s.translation().cast<T>()),
        scale(T(s.scale())) {
    if (first_jet < 0) return;
    T delta[7];
    for (int i = 0; i < 7; ++i) {
      delta[i] = i < 6 || with_scale ? T(0.0, first_jet + i) : T(0.0);
    }
    const Eigen::Quaternion<T> turn(T(1), delta[3] * 0.5, delta[4] * 0.5, delta[5] * 0.5);
    const T factor = T(1) + delta[6];
    translation = turn._transformVector(translation) * factor +
                  Eigen::Matrix<T, 3, 1>(delta[0], delta[1], delta[2]);
    rotation = turn * rotation;
    scale *= factor;
  }
  JetSim3(const Eigen::Quaternion<T>& q, const Eigen::Matrix<T, 3, 1>& t, const T& s)
      : rotation(q), translation(t), scale(s) {}

  JetSim3 operator*(const JetSim3& b) const {
    return {rotation * b.rotation, rotation._transformVector(b.translation) * scale + translation,
            scale * b.scale};
  }
  JetSim3 inverse() const {
    const Eigen::Quaternion<T> conjugate = rotation.conjugate();
    return {conjugate, conjugate._transformVector(translation) * (T(-1) / scale), T(1) / scale};
  }
};

// The residual of E = measured^-1 * a * b^-1 and its Jacobian by (a, b), all by jets.
template <int kSize>
void relative_by_jets(const Sim3d& measured, const Sim3d& a, const Sim3d& b,
                      const Eigen::Matrix<double, kSize, kSize>& information,
                      Eigen::VectorXd* residual, RowMajorMatrix* jacobian) {
  using Jet = ceres::Jet<double, 2 * kSize>;
  const bool with_scale = kSize == 7;
  const JetSim3<Jet> e = JetSim3<Jet>(measured, -1, with_scale).inverse() *
                         JetSim3<Jet>(a, 0, with_scale) *
                         JetSim3<Jet>(b, kSize, with_scale).inverse();
  const double sign = e.rotation.w().a < 0 ? -1 : 1;
  Jet error[7];
  for (int i = 0; i < 3; ++i) error[i] = e.translation[i];
  for (int i = 0; i < 3; ++i) error[3 + i] = e.rotation.vec()[i] * (2 * sign);
  error[6] = log(e.scale);
  Eigen::VectorXd value(kSize);
  RowMajorMatrix derivative(kSize, 2 * kSize);
  for (int i = 0; i < kSize; ++i) {
    value[i] = error[i].a;
    derivative.row(i) = error[i].v;
  }
  const Eigen::Matrix<double, kSize, kSize> lower = information.llt().matrixL();
  *residual = lower.transpose() * value;
  *jacobian = lower.transpose() * derivative;
}

}  // namespace

TEST_CASE("RelativePoseFactor: residual and Jacobians against jets and numeric differences") {
  Random random(41);
  for (int i = 0; i < 100; ++i) {
    const Rigid3d a = random.rigid(3, 3.1);
    const Rigid3d b = random.rigid(3, 3.1);
    // From a perfect measurement to one that is wildly off.
    const Rigid3d measured = a * inverse(b) * random.rigid(0.02 * i, 0.03 * i);
    const Matrix6d information = random_information<6>(random);
    const RelativePoseFactor factor(measured, information);
    const std::vector<FactorBlock> blocks = {{a.params, &kPose}, {b.params, &kPose}};
    const FactorEvaluation evaluation = evaluate(factor, blocks);
    Eigen::VectorXd residual;
    RowMajorMatrix jacobian;
    relative_by_jets<6>(Sim3d(measured), Sim3d(a), Sim3d(b), information, &residual, &jacobian);
    CHECK((evaluation.residual - residual).norm() < 1e-11 * (1 + residual.norm()));
    CHECK(jacobian_mismatch(lifted_jacobian(evaluation, blocks, 0), jacobian.leftCols(6)) < 1e-9);
    CHECK(jacobian_mismatch(lifted_jacobian(evaluation, blocks, 1), jacobian.rightCols(6)) < 1e-9);
    CHECK(factor_mismatch(factor, blocks) < 1e-8);
  }
}

TEST_CASE("RelativeSimilarityFactor: residual and Jacobians against jets and numeric differences") {
  Random random(42);
  for (int i = 0; i < 100; ++i) {
    const Sim3d a = random_similarity(random);
    const Sim3d b = random_similarity(random);
    const Sim3d off(random.rigid(0.02 * i, 0.03 * i));
    const Sim3d measured = a * inverse(b) * off;
    const Matrix7d information = random_information<7>(random);
    const RelativeSimilarityFactor factor(measured, information);
    const std::vector<FactorBlock> blocks = {{a.params, &kSim3}, {b.params, &kSim3}};
    const FactorEvaluation evaluation = evaluate(factor, blocks);
    Eigen::VectorXd residual;
    RowMajorMatrix jacobian;
    relative_by_jets<7>(measured, a, b, information, &residual, &jacobian);
    CHECK((evaluation.residual - residual).norm() < 1e-11 * (1 + residual.norm()));
    CHECK(jacobian_mismatch(lifted_jacobian(evaluation, blocks, 0), jacobian.leftCols(7)) < 1e-9);
    CHECK(jacobian_mismatch(lifted_jacobian(evaluation, blocks, 1), jacobian.rightCols(7)) < 1e-9);
    CHECK(factor_mismatch(factor, blocks) < 1e-8);
  }
}

TEST_CASE("RelativeSimilarityFactor: with scale 1 it is RelativePoseFactor") {
  Random random(43);
  const Rigid3d a = random.rigid(3, 3.1);
  const Rigid3d b = random.rigid(3, 3.1);
  const Rigid3d measured = a * inverse(b) * random.rigid(0.3, 0.3);
  const Matrix6d information = random_information<6>(random);
  Matrix7d with_scale = Matrix7d::Identity();
  with_scale.topLeftCorner<6, 6>() = information;
  const Eigen::VectorXd rigid = residual_of(RelativePoseFactor(measured, information),
                                            {{a.params, nullptr}, {b.params, nullptr}});
  const Eigen::VectorXd similar =
      residual_of(RelativeSimilarityFactor(Sim3d(measured), with_scale),
                  {{Sim3d(a).params, nullptr}, {Sim3d(b).params, nullptr}});
  CHECK((similar.head<6>() - rigid).norm() < 1e-12);
  CHECK(similar[6] == 0);

  Sim3d shrunk(a);
  shrunk.params[7] = -1;
  const FactorEvaluation refused = evaluate(RelativeSimilarityFactor(Sim3d(measured), with_scale),
                                            {{shrunk.params, nullptr}, {Sim3d(b).params, nullptr}});
  CHECK_FALSE(refused.ok);
}

TEST_CASE("PosePrior: value, and Jacobian against numeric differences") {
  Random random(44);
  for (int i = 0; i < 50; ++i) {
    const Rigid3d pose = random.rigid(3, 3.1);
    const Vector6d offset = random.vector(6, 0.03 * i);
    const Matrix6d information = random_information<6>(random);
    const PosePrior factor(se3_exp(-offset) * pose, information);
    const std::vector<FactorBlock> blocks = {{pose.params, &kPose}};
    CHECK(factor_mismatch(factor, blocks) < 1e-8);
    // To first order the residual is the offset; its square is the chi2 of the information.
    const Rigid3d error = se3_exp(offset);
    Vector6d expected;
    expected << error.translation(), 2 * Eigen::Quaterniond(error.rotation()).vec();
    const double chi2 = expected.dot(information * expected);
    CHECK(residual_of(factor, blocks).squaredNorm() == Approx(chi2).epsilon(1e-9).margin(1e-12));
  }
}

TEST_CASE("Pose factors: an information that is singular weighs what it measures") {
  Random random(46);
  for (int i = 0; i < 20; ++i) {
    const Rigid3d measured = random.rigid(2, 3.1);
    Eigen::Matrix<double, 6, 3> root;
    for (int k = 0; k < 3; ++k) root.col(k) = random.vector(6, 1);
    const Matrix6d information = root * root.transpose();
    const RelativePoseFactor factor(measured, information);
    const Rigid3d a = random.rigid(2, 3.1);
    const Rigid3d b = random.rigid(2, 3.1);
    const std::vector<FactorBlock> blocks = {{a.params, &kPose}, {b.params, &kPose}};
    CHECK(factor_mismatch(factor, blocks) < 1e-8);
    const RelativePoseFactor unweighted(measured, Matrix6d::Identity());
    const Vector6d error = residual_of(unweighted, blocks);
    CHECK(residual_of(factor, blocks).squaredNorm() ==
          Approx(error.dot(information * error)).epsilon(1e-9));
  }
  CHECK(whitening_of<6>(Matrix6d::Zero()).isZero());
}

TEST_CASE("PointInFrame: residual and Jacobians") {
  Random random(47);
  for (int i = 0; i < 50; ++i) {
    const Rigid3d sensor_from_cam = random.rigid(1, 3.1);
    const Rigid3d cam_from_world = random.rigid(2, 3.1);
    const Eigen::Vector3d point = random.vector(3, 5);
    const Eigen::Vector3d measured = random.vector(3, 5);
    const Eigen::Matrix3d information = random_information<3>(random);
    const PointInFrame factor(measured, information, sensor_from_cam);
    const std::vector<FactorBlock> blocks = {{cam_from_world.params, &kPose}, {point, nullptr}};
    CHECK(factor_mismatch(factor, blocks) < 1e-8);
    const Eigen::Vector3d error = sensor_from_cam * (cam_from_world * point) - measured;
    CHECK(residual_of(factor, blocks).squaredNorm() ==
          Approx(error.dot(information * error)).epsilon(1e-9));
  }
}

TEST_CASE("Pose factors: an information that is none is our own bug") {
  const Matrix6d indefinite = -Matrix6d::Identity();
  Matrix6d skewed = Matrix6d::Identity();
  skewed(0, 3) = 0.5;
  Matrix6d nan = Matrix6d::Identity();
  nan(2, 2) = std::numeric_limits<double>::quiet_NaN();
  for (const Matrix6d& information : {indefinite, skewed, nan}) {
    CHECK_THROWS_AS(PosePrior(Rigid3d(), information), std::logic_error);
    CHECK_THROWS_AS(RelativePoseFactor(Rigid3d(), information), std::logic_error);
  }
}

TEST_CASE("Pose factors: a square of similarities closes to its truth") {
  Random random(45);
  std::vector<Sim3d> truth, estimate;
  for (int i = 0; i < 4; ++i) {
    truth.push_back(random_similarity(random));
    Vector7d off;
    off << random.vector(6, 0.1), random.uniform(-0.1, 0.1);
    estimate.push_back(i == 0 ? truth[0] : sim3_exp(off) * truth.back());
  }
  ceres::Problem problem;
  for (Sim3d& s : estimate) problem.AddParameterBlock(s.params.data(), 8, new Sim3Manifold);
  problem.SetParameterBlockConstant(estimate[0].params.data());
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t j = (i + 1) % 4;
    problem.AddResidualBlock(
        new RelativeSimilarityFactor(truth[i] * inverse(truth[j]), random_information<7>(random)),
        nullptr, estimate[i].params.data(), estimate[j].params.data());
  }
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.initial_trust_region_radius = 1e12;  // no damping: Gauss-Newton
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  CHECK(summary.iterations.size() < 12);  // Gauss-Newton with right Jacobians is quick
  for (std::size_t i = 0; i < 4; ++i)
    CHECK((sim3_log(estimate[i] * inverse(truth[i]))).norm() < 1e-8);
}

}  // namespace hybrid_slam
