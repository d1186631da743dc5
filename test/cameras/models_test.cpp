#include <algorithm>
#include <limits>
#include <type_traits>
#include <vector>

#include <ceres/jet.h>
#include <catch2/catch.hpp>

#include "cameras/double_sphere.h"
#include "cameras/extended_unified.h"
#include "cameras/field_of_view.h"
#include "cameras/radial_fisheye.h"
#include "cameras/rational.h"
#include "cameras/thin_prism_fisheye.h"
#include "cameras/unified_radtan.h"
#include "test/support/jacobian_check.h"
#include "test/support/test_cameras.h"

namespace hybrid_slam {

template <>
struct TestCamera<DoubleSphere> {
  static Calibrated<DoubleSphere> camera() {
    return {{218.5, 218.4, 512.7, 508.9, -0.27, 0.57}, 1024, 1024};
  }
};

template <>
struct TestCamera<ExtendedUnified> {
  static Calibrated<ExtendedUnified> camera() {
    return {{301.5, 300.4, 512.7, 508.9, 0.62, 1.1}, 1024, 1024};
  }
};

template <>
struct TestCamera<UnifiedRadtan> {
  static Calibrated<UnifiedRadtan> camera() {
    return {{1002.57, 1005.49, 512.7, 378.9, 2.044, -0.116, 0.453, -0.00037, -0.00034}, 1024, 768};
  }
};

template <>
struct TestCamera<Rational> {
  static Calibrated<Rational> camera() {
    return {{712.4, 709.1, 506.3, 391.7, -0.31, 0.12, 0.0011, -0.0007, -0.02, 0.014, -0.006, 0.001},
            1024,
            768};
  }
};

template <>
struct TestCamera<FieldOfView> {
  static Calibrated<FieldOfView> camera() {
    return {{512.4, 509.1, 506.3, 391.7, 0.93}, 1024, 768};
  }
};

template <>
struct TestCamera<RadialFisheye> {
  static Calibrated<RadialFisheye> camera() {
    return {{402.7, 514.9, 508.3, -0.0184, 0.0017}, 1024, 1024};
  }
};

template <>
struct TestCamera<ThinPrismFisheye> {
  static Calibrated<ThinPrismFisheye> camera() {
    return {{402.7, 402.4, 514.9, 508.3, -0.0184, 0.0017, 0.0004, -0.0003, -0.0003, 0.00002, 0.0005,
             -0.0004},
            1024,
            1024};
  }
};

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
                   RectifiedStereo, LeftOfStereo, KannalaBrandt, Radial, Bal, DoubleSphere,
                   ExtendedUnified, UnifiedRadtan) {
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
                   KannalaBrandt, Radial, Bal, DoubleSphere, ExtendedUnified, UnifiedRadtan,
                   Rational, FieldOfView, RadialFisheye, ThinPrismFisheye) {
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
                   RectifiedStereo, LeftOfStereo, KannalaBrandt, Radial, Bal, DoubleSphere,
                   ExtendedUnified, UnifiedRadtan) {
  using M = TestType;
  const auto params = TestCamera<M>::camera().params;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector3d> points{{0, 0, 0}, {0.1, 0.1, nan}};
  if (!std::is_same_v<M, Bal>) {  // which sees both sides
    points.insert(points.end(), {{0, 0, -1}, {1e-9, 0, -2}});
  }
  for (const Eigen::Vector3d& point : points) {
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

TEST_CASE("Radial and BAL: known values, in front and behind") {
  const double f = 500, k1 = -0.2, k2 = 0.04;
  const double scale = 1 + k1 * 0.3125 + k2 * 0.3125 * 0.3125;  // of r^2 = 0.25^2 + 0.5^2
  const double radial[5] = {f, 320, 240, k1, k2};
  const double bal[3] = {f, k1, k2};
  double pixel[2];
  const Eigen::Vector3d ahead(1, -2, 4);
  REQUIRE(Radial::project(radial, ahead.data(), pixel));
  CHECK(pixel[0] == Approx(320 + f * scale * 0.25).epsilon(1e-14));
  CHECK(pixel[1] == Approx(240 - f * scale * 0.5).epsilon(1e-14));
  REQUIRE(Bal::project(bal, ahead.data(), pixel));  // behind a camera that looks along -z
  CHECK(pixel[0] == Approx(-f * scale * 0.25).epsilon(1e-14));
  CHECK(pixel[1] == Approx(f * scale * 0.5).epsilon(1e-14));
  const Eigen::Vector3d other_side(1, -2, -4);
  CHECK_FALSE(Radial::project(radial, other_side.data(), pixel));
  REQUIRE(Bal::project(bal, other_side.data(), pixel));
  CHECK(pixel[0] == Approx(f * scale * 0.25).epsilon(1e-14));
  CHECK(pixel[1] == Approx(-f * scale * 0.5).epsilon(1e-14));

  Random random(14);
  for (int i = 0; i < 20; ++i) {  // the derivatives behind the camera, too
    const Eigen::Vector3d behind(random.uniform(-1, 1), random.uniform(-1, 1), 1.5);
    const Projection<Bal> a = analytic<Bal>(bal, behind);
    const Projection<Bal> j = by_jets<Bal>(bal, behind);
    CHECK(jacobian_mismatch(a.d_point, j.d_point) < 1e-12);
    CHECK(jacobian_mismatch(a.d_params, j.d_params) < 1e-12);
  }
}

TEST_CASE("Radial: beyond the radius where the distortion stops growing") {
  // r + k1 r^3 grows up to r = 1 / sqrt(-3 k1): here 1, where the distorted radius is 2/3.
  const double params[5] = {300, 500, 400, -1.0 / 3, 0};
  CHECK(RadialDistortion{-1.0 / 3, 0}.max_radius() == Approx(1).epsilon(1e-14));
  double out[3];
  const double beyond[3] = {3, 0, 2};
  REQUIRE(Radial::project(params, beyond, out));
  CHECK(out[0] == Approx(500 + 300 * (1.5 - 1.5 * 1.5 * 1.5 / 3)));
  const double outside[2] = {500 + 300 * 0.667, 400};
  const double inside[2] = {500 + 300 * 0.666, 400};
  CHECK_FALSE(Radial::unproject(params, outside, out));
  REQUIRE(Radial::unproject(params, inside, out));
  CHECK(out[0] / out[2] < 1);
  // (1 - 4 w)(1 - w / 4) is the derivative for k1 = -4.25 / 3, k2 = 1 / 5: it recovers later on.
  CHECK(RadialDistortion{-4.25 / 3, 0.2}.max_radius() == Approx(0.5).epsilon(1e-14));
  CHECK(std::isinf(RadialDistortion{0, 0}.max_radius()));
  CHECK(std::isinf(RadialDistortion{0.3, 0.1}.max_radius()));
  CHECK(std::isinf(RadialDistortion{-0.4, 0.2}.max_radius()));  // dips, but stays above zero
  const double nan[2] = {std::numeric_limits<double>::quiet_NaN(), 0};
  CHECK_FALSE(Radial::unproject(params, nan, out));
  CHECK_FALSE(Bal::unproject(params, nan, out));
}

TEST_CASE("Radial: unproject cannot diverge") {
  Random random(15);
  int inverted = 0;
  for (int i = 0; i < 5000; ++i) {
    const RadialDistortion distortion{random.uniform(-1, 1), random.uniform(-1, 1)};
    const double limit = distortion.max_radius();
    const double distorted = random.uniform(0, 3);
    double r = -1;
    if (distortion.undistort(distorted, r)) {
      const double again = r * (1 + r * r * (distortion.k1 + r * r * distortion.k2));
      CAPTURE(distortion.k1, distortion.k2, distorted, limit, r);
      CHECK(r <= limit);
      CHECK(again == Approx(distorted).epsilon(1e-13).margin(1e-13));
      ++inverted;
    } else {
      CHECK(distorted >
            limit * (1 + limit * limit * (distortion.k1 + limit * limit * distortion.k2)));
    }
  }
  CHECK(inverted > 2000);
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

TEST_CASE("Unified models: known values, and where they end") {
  const double spheres[6] = {300, 200, 500, 400, 0, 0.5};   // r = 2 tan(theta / 2)
  const double extended[6] = {300, 200, 500, 400, 0.5, 1};  // the same
  const double radtan[9] = {600, 400, 500, 400, 1};         // r = tan(theta / 2)
  for (const double theta : {0.3, 1.2, 1.7, 2.5}) {
    const Eigen::Vector3d point(1.2 * std::sin(theta), 1.6 * std::sin(theta), 2 * std::cos(theta));
    const double r = 2 * std::tan(theta / 2);
    for (int model = 0; model < 3; ++model) {
      CAPTURE(theta, model);
      double pixel[2];
      const bool projected = model == 0   ? DoubleSphere::project(spheres, point.data(), pixel)
                             : model == 1 ? ExtendedUnified::project(extended, point.data(), pixel)
                                          : UnifiedRadtan::project(radtan, point.data(), pixel);
      REQUIRE(projected);
      CHECK(pixel[0] == Approx(500 + 300 * 0.6 * r).epsilon(1e-12));
      CHECK(pixel[1] == Approx(400 + 200 * 0.8 * r).epsilon(1e-12));
    }
  }
  // xi = 1, alpha = 0.5: z > -w2 d1 with w2 = 2 / 2.
  const double wide[6] = {300, 300, 500, 500, 1, 0.5};
  double pixel[2], bearing[3];
  const double behind[3] = {0.01, 0, -1};
  CHECK(DoubleSphere::project(wide, behind, pixel));
  // alpha = 0.6, xi = 0: z > -(2 / 3) d.
  const double narrow[6] = {300, 300, 500, 500, 0, 0.6};
  const auto sees = [&](double cosine) {
    const double point[3] = {std::sqrt(1 - cosine * cosine), 0, cosine};
    return DoubleSphere::project(narrow, point, pixel);
  };
  CHECK(sees(-0.66));
  CHECK_FALSE(sees(-0.67));
  const double outside[2] = {500 + 300 * 2.25, 500};  // r^2 <= 1 / (2 alpha - 1) = 5
  CHECK_FALSE(DoubleSphere::unproject(narrow, outside, bearing));
  const double nan[2] = {std::numeric_limits<double>::quiet_NaN(), 0};
  CHECK_FALSE(DoubleSphere::unproject(narrow, nan, bearing));
  CHECK_FALSE(ExtendedUnified::unproject(extended, nan, bearing));
  CHECK_FALSE(UnifiedRadtan::unproject(radtan, nan, bearing));
}

TEST_CASE("COLMAP's wide models: known values") {
  double pixel[2];
  const double point[3] = {1, -2, 4};  // m = (0.25, -0.5), r^2 = 0.3125
  const double r2 = 0.3125;
  const double rational[12] = {500, 400, 320, 240, 0.1, 0.2, 0.01, 0.02, 0.3, 0.04, 0.05, 0.06};
  REQUIRE(Rational::project(rational, point, pixel));
  const double s = (1 + 0.1 * r2 + 0.2 * r2 * r2 + 0.3 * r2 * r2 * r2) /
                   (1 + 0.04 * r2 + 0.05 * r2 * r2 + 0.06 * r2 * r2 * r2);
  CHECK(pixel[0] == Approx(320 + 500 * (0.25 * s - 0.02 * 0.125 + 0.02 * (r2 + 2 * 0.0625))));
  CHECK(pixel[1] == Approx(240 + 400 * (-0.5 * s + 0.01 * (r2 + 0.5) - 0.04 * 0.125)));

  const double fov[5] = {500, 400, 320, 240, 0.9};
  REQUIRE(FieldOfView::project(fov, point, pixel));
  const double factor = std::atan(2 * std::sqrt(r2) * std::tan(0.45)) / (std::sqrt(r2) * 0.9);
  CHECK(pixel[0] == Approx(320 + 500 * 0.25 * factor));
  CHECK(pixel[1] == Approx(240 - 400 * 0.5 * factor));
  const double pinhole[5] = {500, 400, 320, 240, 1e-9};
  REQUIRE(FieldOfView::project(pinhole, point, pixel));
  CHECK(pixel[0] == Approx(320 + 125));

  const double theta = std::atan(std::sqrt(r2));
  const double radial[5] = {500, 320, 240, 0.1, -0.05};
  REQUIRE(RadialFisheye::project(radial, point, pixel));
  const double theta_d = theta * (1 + 0.1 * theta * theta - 0.05 * std::pow(theta, 4));
  CHECK(pixel[0] == Approx(320 + 500 * theta_d * 0.25 / std::sqrt(r2)));

  const double prism[12] = {500, 400, 320, 240, 0.1, 0.2, 0.01, 0.02, 0.3, 0.04, 0.05, 0.06};
  REQUIRE(ThinPrismFisheye::project(prism, point, pixel));
  const double mx = theta * 0.25 / std::sqrt(r2), my = -theta * 0.5 / std::sqrt(r2),
               t2 = theta * theta;
  const double bend = 1 + 0.1 * t2 + 0.2 * t2 * t2 + 0.3 * std::pow(t2, 3) + 0.04 * std::pow(t2, 4);
  CHECK(pixel[0] ==
        Approx(320 + 500 * (mx * bend + 0.02 * mx * my + 0.02 * (t2 + 2 * mx * mx) + 0.05 * t2)));
  CHECK(pixel[1] ==
        Approx(240 + 400 * (my * bend + 0.01 * (t2 + 2 * my * my) + 0.04 * mx * my + 0.06 * t2)));
}

}  // namespace hybrid_slam
