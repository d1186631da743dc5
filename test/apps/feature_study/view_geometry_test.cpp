#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "apps/feature_eval/study/view_geometry.h"
#include "cameras/geometry/so3.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

const Rigid3d kTruth(so3_exp({0.3, -0.9, 0.4}), Eigen::Vector3d(0.5, 0.7, -0.2));

// Points around `middle` (in camera a), seen by both; every third match is wrong.
MatchedBearings make_matches(const Eigen::Vector3d& middle, const Rigid3d& a_from_b, int count,
                             bool with_outliers) {
  Random random(7);
  MatchedBearings matches;
  for (int i = 0; i < count; ++i) {
    const auto place = [&] {
      return Eigen::Vector3d(middle + Eigen::Vector3d(random.uniform(-1, 1), random.uniform(-1, 1),
                                                      random.uniform(-1, 1)));
    };
    const Eigen::Vector3d point = place();
    const Eigen::Vector3d other = with_outliers && i % 3 == 0 ? place() : point;
    matches.a.push_back(point.normalized());
    matches.b.push_back((inverse(a_from_b) * other).normalized());
  }
  return matches;
}

TEST_CASE(
    "the motion between two views is found among wrong matches, on the plane and on bearings") {
  const MatchedBearings matches = make_matches({0.3, 0.2, 3}, kTruth, 120, true);
  for (auto* const solve : {motion_on_plane, motion_on_bearings}) {
    const auto motion = solve(matches, {});
    REQUIRE(motion);
    CHECK(rotation_error_deg(motion->a_from_b, kTruth) < 0.5);
    CHECK(direction_error_deg(motion->a_from_b, kTruth) < 0.5);
    CHECK(motion->a_from_b.translation().norm() == Approx(1));
    for (std::size_t i = 0; i < matches.a.size(); ++i) {
      if (i % 3 != 0) CHECK(motion->inlier[i] == 1);
    }
    CHECK(motion->inliers >= 80);
    CHECK(motion->inliers <= 90);  // a wrong one may lie on its epipolar line
  }
}

TEST_CASE("rays beyond 90 degrees count on bearings, and are left out on the plane") {
  const MatchedBearings matches = make_matches({0.2, 2.5, -0.1}, kTruth, 200, false);
  int ahead = 0;
  for (std::size_t i = 0; i < matches.a.size(); ++i) {
    ahead += matches.a[i].z() > 0 && matches.b[i].z() > 0 ? 1 : 0;
  }
  REQUIRE(ahead > 10);
  REQUIRE(ahead < 150);
  const auto on_plane = motion_on_plane(matches, {});
  REQUIRE(on_plane);
  CHECK(on_plane->inliers <= ahead);
  for (std::size_t i = 0; i < matches.a.size(); ++i) {
    if (matches.a[i].z() <= 0 || matches.b[i].z() <= 0) CHECK(on_plane->inlier[i] == 0);
  }
  const auto on_bearings = motion_on_bearings(matches, {});
  REQUIRE(on_bearings);
  CHECK(on_bearings->inliers == 200);
  CHECK(rotation_error_deg(on_bearings->a_from_b, kTruth) < 0.1);
  CHECK(direction_error_deg(on_bearings->a_from_b, kTruth) < 0.1);
  const MatchedBearings behind = make_matches({0.2, 0.1, -3}, kTruth, 60, false);
  CHECK_FALSE(motion_on_plane(behind, {}));
  const auto found = motion_on_bearings(behind, {});
  REQUIRE(found);
  CHECK(direction_error_deg(found->a_from_b, kTruth) < 0.1);
}

TEST_CASE("five matches are no evidence for a motion") {
  const MatchedBearings matches = make_matches({0, 0, 3}, kTruth, 5, false);
  CHECK_FALSE(motion_on_plane(matches, {}));
  CHECK_FALSE(motion_on_bearings(matches, {}));
  CHECK_FALSE(motion_on_plane({}, {}));
  CHECK_FALSE(motion_on_bearings({}, {}));
}

TEST_CASE("Sampson's distance on the sphere is the angle out of the plane, shared by both views") {
  // Both views are as far from the point, and the baseline is along x.
  const Eigen::Matrix3d essential = hat({1, 0, 0});
  const Eigen::Vector3d a = Eigen::Vector3d(0.5, 0, 2).normalized();
  const Eigen::Vector3d b = Eigen::Vector3d(-0.5, 0, 2).normalized();
  CHECK(sphere_distance(essential, a, b) < 1e-15);
  constexpr double kAngle = 1e-4;
  const Eigen::Vector3d lifted = a * std::cos(kAngle) + Eigen::Vector3d::UnitY() * std::sin(kAngle);
  CHECK(sphere_distance(essential, lifted, b) ==
        Approx(kAngle / std::numbers::sqrt2).epsilon(1e-4));
  CHECK(sphere_distance(7 * essential, lifted, b) ==
        Approx(kAngle / std::numbers::sqrt2).epsilon(1e-4));
  const Eigen::Vector3d along = (a + 0.1 * Eigen::Vector3d::UnitX()).normalized();
  CHECK(sphere_distance(essential, along, b) < 1e-15);
}

TEST_CASE("errors of rotation and direction are the angles by which they were turned") {
  constexpr double kRadians = std::numbers::pi / 180;
  for (const double degrees : {0.0, 0.01, 30.0, 90.0, 179.5}) {
    const Rigid3d turned(
        so3_exp(degrees * kRadians * Eigen::Vector3d(0.6, 0, 0.8)) * kTruth.rotation(),
        kTruth.translation());
    CHECK(rotation_error_deg(turned, kTruth) == Approx(degrees).margin(1e-6));
    CHECK(direction_error_deg(turned, kTruth) == Approx(0).margin(1e-6));
    const Eigen::Vector3d normal =
        kTruth.translation().cross(Eigen::Vector3d::UnitX()).normalized();
    const Rigid3d moved(kTruth.rotation(),
                        3 * (so3_exp(degrees * kRadians * normal) * kTruth.translation()));
    CHECK(rotation_error_deg(moved, kTruth) == Approx(0).margin(1e-6));
    CHECK(direction_error_deg(moved, kTruth) == Approx(degrees).margin(1e-6));
  }
}

}  // namespace
}  // namespace hybrid_slam
