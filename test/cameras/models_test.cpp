#include <algorithm>
#include <limits>

#include <ceres/jet.h>
#include <catch2/catch.hpp>

#include "test/support/jacobian_check.h"
#include "test/support/test_cameras.h"

namespace hybrid_slam {
namespace {

template <typename M>
struct Projection {
  Eigen::VectorXd measurement = Eigen::VectorXd::Zero(M::kMeasurementDim);
  RowMajorMatrix d_point = RowMajorMatrix::Zero(M::kMeasurementDim, 3);
  RowMajorMatrix d_params = RowMajorMatrix::Zero(M::kMeasurementDim, M::kParamCount);
  bool ok = false;
};

template <typename M>
Projection<M> analytic(const double* params, const Eigen::Vector3d& point) {
  Projection<M> p;
  p.ok = M::project_with_jacobians(params, point.data(), p.measurement.data(), p.d_point.data(),
                                   p.d_params.data());
  return p;
}

template <typename M>
Projection<M> by_jets(const double* params, const Eigen::Vector3d& point) {
  constexpr int kCount = 3 + M::kParamCount;
  using Jet = ceres::Jet<double, kCount>;
  Jet jet_params[M::kParamCount];
  Jet jet_point[3];
  Jet measurement[M::kMeasurementDim];
  for (int i = 0; i < 3; ++i) jet_point[i] = Jet(point[i], i);
  for (int i = 0; i < M::kParamCount; ++i) jet_params[i] = Jet(params[i], 3 + i);
  Projection<M> p;
  p.ok = M::project(jet_params, jet_point, measurement);
  if (!p.ok) return p;
  for (int row = 0; row < M::kMeasurementDim; ++row) {
    p.measurement[row] = measurement[row].a;
    p.d_point.row(row) = measurement[row].v.template head<3>();
    p.d_params.row(row) = measurement[row].v.template tail<M::kParamCount>();
  }
  return p;
}

}  // namespace

TEMPLATE_TEST_CASE("Models: analytic Jacobians against jets and numeric differences", "", Pinhole,
                   RectifiedStereo, LeftOfStereo, KannalaBrandt) {
  using M = TestType;
  Random random(11);
  const auto params = TestCamera<M>::camera().params;
  for (const Eigen::Vector3d& point : test_points<M>(random)) {
    CAPTURE(point.transpose());
    const Projection<M> a = analytic<M>(params.data(), point);
    const Projection<M> j = by_jets<M>(params.data(), point);
    REQUIRE(a.ok);
    REQUIRE(j.ok);
    CHECK((a.measurement - j.measurement).norm() < 1e-10);
    CHECK(jacobian_mismatch(a.d_point, j.d_point) < 1e-12);
    CHECK(jacobian_mismatch(a.d_params, j.d_params) < 1e-12);

    const auto of_point = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
      return analytic<M>(params.data(), x).measurement;
    };
    CHECK(jacobian_mismatch(a.d_point, numeric_jacobian(of_point, point, 1e-4 * point.norm())) <
          1e-8);
    const auto of_params = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
      return analytic<M>(x.data(), point).measurement;
    };
    const Eigen::VectorXd x =
        Eigen::Map<const Eigen::VectorXd>(params.data(), static_cast<int>(params.size()));
    CHECK(jacobian_mismatch(a.d_params, numeric_jacobian(of_params, x, 1e-4)) < 1e-7);
  }
}

TEMPLATE_TEST_CASE("Models: unproject inverts project", "", Pinhole, RectifiedStereo, LeftOfStereo,
                   KannalaBrandt) {
  using M = TestType;
  Random random(12);
  const auto params = TestCamera<M>::camera().params;
  for (const Eigen::Vector3d& point : test_points<M>(random)) {
    CAPTURE(point.transpose());
    double measurement[M::kMeasurementDim] = {};
    REQUIRE(M::project(params.data(), point.data(), measurement));
    Eigen::Vector3d bearing = Eigen::Vector3d::Zero();
    REQUIRE(M::unproject(params.data(), measurement, bearing.data()));
    CHECK(std::abs(bearing.norm() - 1) < 1e-14);
    CHECK((bearing - point.normalized()).norm() < 1e-11);
  }
}

TEMPLATE_TEST_CASE("Models: what cannot be projected leaves the output untouched", "", Pinhole,
                   RectifiedStereo, LeftOfStereo, KannalaBrandt) {
  using M = TestType;
  const auto params = TestCamera<M>::camera().params;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1e-9, 0, -2),
        Eigen::Vector3d(0.1, 0.1, nan)}) {
    double measurement[3] = {-7, -8, -9};
    CHECK_FALSE(M::project(params.data(), point.data(), measurement));
    double d_point[9];
    CHECK_FALSE(
        M::project_with_jacobians(params.data(), point.data(), measurement, d_point, nullptr));
    CHECK(measurement[0] == -7);
    CHECK(measurement[1] == -8);
    CHECK(measurement[2] == -9);
  }
}

TEST_CASE("Pinhole and stereo: known values") {
  const double params[5] = {500, 400, 320, 240, 0.2};
  const double point[3] = {1, -2, 4};
  double measurement[3];
  REQUIRE(RectifiedStereo::project(params, point, measurement));
  CHECK(measurement[0] == Approx(445));
  CHECK(measurement[1] == Approx(40));
  CHECK(measurement[2] == Approx(445 - 500 * 0.2 / 4));
  REQUIRE(Pinhole::project(params, point, measurement));
  CHECK(measurement[0] == Approx(445));
  CHECK(measurement[1] == Approx(40));
  const double on_the_plane[3] = {1, 1, 0};
  CHECK_FALSE(Pinhole::project(params, on_the_plane, measurement));
}

TEST_CASE("Kannala-Brandt: known values, beyond 90 degrees too") {
  const double params[8] = {300, 200, 500, 400, 0.1, -0.01, 0.002, -0.0003};
  for (const double theta : {0.3, 1.2, 1.7, 2.0}) {
    const double point[3] = {2 * std::sin(theta), 0, 2 * std::cos(theta)};
    double pixel[2];
    REQUIRE(KannalaBrandt::project(params, point, pixel));
    const double theta_d = theta + 0.1 * std::pow(theta, 3) - 0.01 * std::pow(theta, 5) +
                           0.002 * std::pow(theta, 7) - 0.0003 * std::pow(theta, 9);
    CHECK(pixel[0] == Approx(500 + 300 * theta_d).epsilon(1e-12));
    CHECK(pixel[1] == Approx(400));
  }
}

TEST_CASE("Kannala-Brandt: refuses what lies beyond its monotone range") {
  // theta_d = theta - k theta^3 grows up to theta = 1 / sqrt(3 k).
  double params[8] = {300, 300, 500, 500, -1.0 / 3, 0, 0, 0};
  CHECK(KannalaBrandt::max_angle(params) == Approx(1).epsilon(1e-9));
  const auto projects = [&](double theta) {
    const double point[3] = {0, std::sin(theta), std::cos(theta)};
    double pixel[2];
    return KannalaBrandt::project(params, point, pixel);
  };
  CHECK(projects(0.9999));
  CHECK_FALSE(projects(1.0001));
  CHECK_FALSE(projects(2.5));
  // A dip that the derivative leaves again: theta_d' = (1 - 4 w)(1 - w / 4), w = theta^2.
  params[4] = -4.25 / 3;
  params[5] = 1.0 / 5;
  CHECK(KannalaBrandt::max_angle(params) == Approx(0.5).epsilon(1e-9));
  CHECK(projects(0.4999));
  CHECK_FALSE(projects(0.5001));
  CHECK_FALSE(projects(2.2));
  // Without distortion the range ends at pi.
  params[4] = params[5] = 0;
  CHECK(KannalaBrandt::max_angle(params) == KannalaBrandt::kMaxAngle);
  CHECK(projects(3.1415));
}

TEST_CASE("Kannala-Brandt: unproject refuses pixels that no ray has, and nothing diverges") {
  Random random(13);
  for (int i = 0; i < 2000; ++i) {
    double params[8] = {300, 310, 500, 490};
    for (int k = 4; k < 8; ++k) params[k] = random.uniform(-0.3, 0.3);
    const double limit = KannalaBrandt::max_angle(params);
    const double theta = std::min(random.uniform(0, 1.5 * limit), 3.14);
    const double pixel[2] = {random.uniform(-2000, 3000), random.uniform(-2000, 3000)};
    Eigen::Vector3d bearing = Eigen::Vector3d::Zero();
    if (KannalaBrandt::unproject(params, pixel, bearing.data())) {
      double again[2];
      CAPTURE(bearing.transpose(), limit);
      const double angle = std::atan2(bearing.head<2>().norm(), bearing[2]);
      CHECK(angle <= limit * (1 + 1e-12));
      if (angle < limit * (1 - 1e-6)) {
        REQUIRE(KannalaBrandt::project(params, bearing.data(), again));
        CHECK(std::hypot(again[0] - pixel[0], again[1] - pixel[1]) < 1e-7);
      }
    }
    const Eigen::Vector3d point(std::sin(theta), 0, std::cos(theta));
    double projected[2];
    CHECK(KannalaBrandt::project(params, point.data(), projected) == (theta <= limit));
  }
  const double params[8] = {300, 300, 500, 500, -1.0 / 3, 0, 0, 0};  // theta_d <= 2 / 3
  double bearing[3];
  const double outside[2] = {500 + 300 * 0.667, 500};
  const double inside[2] = {500 + 300 * 0.666, 500};
  CHECK_FALSE(KannalaBrandt::unproject(params, outside, bearing));
  CHECK(KannalaBrandt::unproject(params, inside, bearing));
  const double nan[2] = {std::numeric_limits<double>::quiet_NaN(), 0};
  CHECK_FALSE(KannalaBrandt::unproject(params, nan, bearing));
  CHECK_FALSE(Pinhole::unproject(params, nan, bearing));
}

}  // namespace hybrid_slam
