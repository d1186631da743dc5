#include "factors/reprojection_factor.h"

#include <limits>
#include <memory>

#include <ceres/jet.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <catch2/catch.hpp>

#include "factors/make_reprojection_factor.h"
#include "factors/manifolds.h"
#include "test/support/factor_check.h"
#include "test/support/test_cameras.h"

namespace hybrid_slam {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const PoseManifold kPoseManifold;

// One observation: where a camera at cam_from_world should see a point, and what it measured.
template <typename M>
struct Observation {
  Rigid3d cam_from_world;
  Eigen::Vector3d point_in_world;
  double measurement[3];
  double sigma;
};

template <typename M>
std::vector<Observation<M>> observations(Random& random) {
  const auto params = TestCamera<M>::camera().params;
  std::vector<Observation<M>> result;
  for (const Eigen::Vector3d& point : test_points<M>(random)) {
    // Where no principal point is a parameter, the derivatives by the intrinsics vanish on the
    // axis: there would be nothing to compare but rounding errors.
    if (std::is_same_v<M, Bal> && point.head<2>().norm() < 5e-3 * std::abs(point[2])) continue;
    Observation<M> o;
    o.cam_from_world = random.rigid(5, 3.1);
    o.point_in_world = inverse(o.cam_from_world) * point;
    o.sigma = random.uniform(0.5, 3);
    REQUIRE(M::template project<double>(params.data(), point.data(), o.measurement));
    for (double& x : o.measurement) x += random.gaussian();
    result.push_back(o);
  }
  return result;
}

template <typename M>
std::vector<FactorBlock> blocks_of(const Observation<M>& o) {
  return {{o.cam_from_world.params, &kPoseManifold}, {o.point_in_world, nullptr}};
}

// The same residual written with jets: an independent derivative, by delta (6), point (3), params.
template <typename M>
RowMajorMatrix jacobian_by_jets(const Observation<M>& o) {
  constexpr int kCount = 9 + M::kParamCount;
  using Jet = ceres::Jet<double, kCount>;
  const auto values = TestCamera<M>::camera().params;
  Jet delta[6], world[3], params[M::kParamCount], measurement[M::kMeasurementDim];
  for (int i = 0; i < 6; ++i) delta[i] = Jet(0.0, i);
  for (int i = 0; i < 3; ++i) world[i] = Jet(o.point_in_world[i], 6 + i);
  for (std::size_t i = 0; i < values.size(); ++i) {
    params[i] = Jet(values[i], 9 + static_cast<int>(i));
  }
  const Eigen::Quaternion<Jet> rotation = o.cam_from_world.rotation().template cast<Jet>();
  const Eigen::Quaternion<Jet> turn(Jet(1), delta[3] * 0.5, delta[4] * 0.5, delta[5] * 0.5);
  const Eigen::Matrix<Jet, 3, 1> moved =
      turn._transformVector(rotation._transformVector(Eigen::Map<Eigen::Matrix<Jet, 3, 1>>(world)) +
                            o.cam_from_world.translation().template cast<Jet>()) +
      Eigen::Map<Eigen::Matrix<Jet, 3, 1>>(delta);
  REQUIRE(M::project(params, moved.data(), measurement));
  RowMajorMatrix jacobian(M::kMeasurementDim, kCount);
  for (int i = 0; i < M::kMeasurementDim; ++i) jacobian.row(i) = measurement[i].v / o.sigma;
  return jacobian;
}

// A factor whose author got one sign wrong: that of a column of one block's Jacobian.
class WrongSign final : public ceres::CostFunction {
 public:
  WrongSign(const ceres::CostFunction& factor, std::size_t block, int column)
      : factor_(factor), block_(block), column_(column) {
    set_num_residuals(factor.num_residuals());
    *mutable_parameter_block_sizes() = factor.parameter_block_sizes();
  }

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    if (!factor_.Evaluate(blocks, residual, jacobians)) return false;
    if (jacobians == nullptr || jacobians[block_] == nullptr) return true;
    const int cols = parameter_block_sizes()[block_];
    for (int row = 0; row < num_residuals(); ++row) jacobians[block_][row * cols + column_] *= -1;
    return true;
  }

 private:
  const ceres::CostFunction& factor_;
  std::size_t block_;
  int column_;
};

}  // namespace

TEMPLATE_TEST_CASE("Reprojection: Jacobians against jets and numeric differences", "", Pinhole,
                   RectifiedStereo, LeftOfStereo, KannalaBrandt, Radial, Bal) {
  using M = TestType;
  Random random(21);
  const auto params = TestCamera<M>::camera().params;
  for (const Observation<M>& o : observations<M>(random)) {
    CAPTURE((o.cam_from_world * o.point_in_world).transpose());
    const ReprojectionFactor<M, Intrinsics::kRefined> factor({}, o.measurement, o.sigma);
    std::vector<FactorBlock> blocks = blocks_of(o);
    blocks.push_back({Eigen::Map<const Eigen::VectorXd>(params.data(), M::kParamCount), nullptr});

    const FactorEvaluation evaluation = evaluate(factor, blocks);
    REQUIRE(evaluation.ok);
    const RowMajorMatrix jets = jacobian_by_jets(o);
    CHECK(jacobian_mismatch(evaluation.jacobians[0].leftCols(6), jets.leftCols(6)) < 1e-9);
    CHECK(evaluation.jacobians[0].col(6).isZero(0));
    CHECK(jacobian_mismatch(evaluation.jacobians[1], jets.middleCols(6, 3)) < 1e-9);
    CHECK(jacobian_mismatch(evaluation.jacobians[2], jets.rightCols(M::kParamCount)) < 1e-9);
    CHECK(factor_mismatch(factor, blocks, 2e-4) < 1e-6);

    // With fixed intrinsics: the same numbers.
    const ReprojectionFactor<M> fixed(params, o.measurement, o.sigma);
    const FactorEvaluation fixed_evaluation = evaluate(fixed, blocks_of(o));
    REQUIRE(fixed_evaluation.ok);
    CHECK(fixed_evaluation.residual == evaluation.residual);
    CHECK(fixed_evaluation.jacobians[0] == evaluation.jacobians[0]);
    CHECK(fixed_evaluation.jacobians[1] == evaluation.jacobians[1]);
  }
}

TEMPLATE_TEST_CASE("Reprojection: the residual is the error in standard deviations", "", Pinhole,
                   RectifiedStereo, KannalaBrandt, Radial, Bal) {
  using M = TestType;
  Random random(22);
  const Camera camera = TestCamera<M>::camera();
  const Rigid3d cam_from_world = random.rigid(2, 1);
  const Eigen::Vector3d point_in_cam(0.4, -0.3, 2.5);
  Eigen::Vector3d measurement(0, 0, kNan);
  measurement.head<2>() = *project(camera, point_in_cam);
  if (const auto stereo = project_stereo(camera, point_in_cam)) measurement = *stereo;
  const Eigen::Vector3d offset(3, -1, 2);
  const auto factor = make_reprojection_factor(camera, measurement - offset, 2);
  const Eigen::VectorXd residual = residual_of(
      *factor,
      {{cam_from_world.params, nullptr}, {inverse(cam_from_world) * point_in_cam, nullptr}});
  CHECK((residual - offset.head(M::kMeasurementDim) / 2).norm() < 1e-9);
}

TEST_CASE("Reprojection: any single wrong sign is caught by the checker") {
  Random random(23);
  const auto params = TestCamera<RectifiedStereo>::camera().params;
  const Eigen::Vector3d point(0.7, -0.4, 2);
  double measurement[3];
  REQUIRE(RectifiedStereo::project(params.data(), point.data(), measurement));
  const Rigid3d cam_from_world = random.rigid(1, 2);
  const ReprojectionFactor<RectifiedStereo, Intrinsics::kRefined> factor({}, measurement, 1);
  const std::vector<FactorBlock> blocks = {
      {cam_from_world.params, &kPoseManifold},
      {inverse(cam_from_world) * point, nullptr},
      {Eigen::Map<const Eigen::VectorXd>(params.data(), 5), nullptr}};
  REQUIRE(factor_mismatch(factor, blocks) < 1e-7);
  for (std::size_t block = 0; block < blocks.size(); ++block) {
    for (int column = 0; column < blocks[block].tangent_size(); ++column) {
      CAPTURE(block, column);
      CHECK(factor_mismatch(WrongSign(factor, block, column), blocks) > 1e-4);
    }
  }
}

TEST_CASE("Reprojection: a stereo pair's point without right match is a 2-d measurement") {
  const Camera camera = TestCamera<RectifiedStereo>::camera();
  const auto mono = make_reprojection_factor(camera, {500, 400, kNan}, 1.5);
  CHECK(mono->num_residuals() == 2);
  CHECK(make_reprojection_factor(camera, {500, 400, 480}, 1.5)->num_residuals() == 3);
  const auto refining = make_refining_reprojection_factor(camera, {500, 400, kNan}, 1.5);
  CHECK(refining->num_residuals() == 2);
  CHECK(refining->parameter_block_sizes() == std::vector<int>{7, 3, 5});

  const Eigen::Vector3d point(0.1, 0.2, 3);
  const Eigen::VectorXd residual = residual_of(*mono, {{Rigid3d().params, nullptr}, {point, {}}});
  CHECK((residual - (*project(camera, point) - Eigen::Vector2d(500, 400)) / 1.5).norm() < 1e-12);
}

TEST_CASE("Reprojection: a measurement that is no number, or a sigma of zero, is our own bug") {
  const Camera camera = TestCamera<Pinhole>::camera();
  CHECK_THROWS_AS(make_reprojection_factor(camera, {kNan, 1, 1}, 1), std::logic_error);
  CHECK_THROWS_AS(make_reprojection_factor(camera, {1, 1, 1}, 0), std::logic_error);
  CHECK_THROWS_AS(make_reprojection_factor(camera, {1, 1, 1}, kNan), std::logic_error);
}

TEST_CASE("Reprojection: behind the camera Evaluate refuses, and Ceres turns back") {
  const Camera camera = TestCamera<Pinhole>::camera();
  const Rigid3d cam_from_world;
  const auto solve = [&](Eigen::Vector3d start, const Eigen::Vector3d& truth, double* pose) {
    ceres::Problem problem;
    Eigen::Vector3d measurement(0, 0, kNan);
    measurement.head<2>() = *project(camera, truth);
    problem.AddParameterBlock(pose, 7, new PoseManifold);
    problem.SetParameterBlockConstant(pose);
    problem.AddResidualBlock(make_reprojection_factor(camera, measurement, 1).release(), nullptr,
                             pose, start.data());
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.initial_trust_region_radius = 1e8;  // a bold first step, to behind the camera
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    return summary;
  };
  Rigid3d pose;
  const auto from_behind = solve({0, 0, -1}, {0, 0, 1}, pose.params.data());
  CHECK(from_behind.termination_type == ceres::FAILURE);

  // Far off the axis and close to the camera's plane, the linear step overshoots.
  const auto from_afar = solve({1, 0, 0.1}, {-0.5, 0, 1}, pose.params.data());
  CHECK(from_afar.num_unsuccessful_steps > 0);
  CHECK(from_afar.termination_type == ceres::CONVERGENCE);
  CHECK(from_afar.final_cost < 1e-6);
}

}  // namespace hybrid_slam
