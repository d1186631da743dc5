#include "frontend/pose/pnp_ransac.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "test/frontend/pose/pose_scene.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

struct Scene {
  Rigid3d truth;
  std::vector<Eigen::Vector3d> bearings;
  std::vector<Eigen::Vector3d> points;
  std::vector<double> sigma;
  std::vector<char> is_outlier;

  auto solve(const PnpRansacOptions& options = {}) const {
    return solve_pnp_ransac(bearings, points, sigma, options);
  }
};

struct SceneOptions {
  int count = 100;
  double max_angle = 0.6;  // of the rays off the axis [rad]
  double outlier_share = 0.5;
  double sigma = 0.001;  // [rad]
  bool planar = false;
  std::uint64_t seed = 0;
};

Scene make_scene(const SceneOptions& options) {
  Random random(options.seed);
  Scene scene;
  scene.truth = random.rigid(20, 3);
  for (int i = 0; i < options.count; ++i) {
    Eigen::Vector3d ray = random.direction();
    while (std::acos(ray.z()) > options.max_angle) ray = random.direction();
    const Eigen::Vector3d point =
        ray * (options.planar ? 5 / (ray.z() + 0.3 * ray.x()) : random.uniform(2, 12));
    const Eigen::Vector3d side = ray.unitOrthogonal();
    Eigen::Vector3d bearing =
        ray + options.sigma * (random.gaussian() * side + random.gaussian() * ray.cross(side));
    const bool outlier = random.uniform(0, 1) < options.outlier_share;
    if (outlier) {
      do {
        bearing = random.direction();
      } while (std::acos(bearing.z()) > options.max_angle || bearing.dot(ray) > 0.999);
    }
    scene.bearings.push_back(bearing.normalized());
    scene.points.push_back(inverse(scene.truth) * point);
    scene.sigma.push_back(options.sigma);
    scene.is_outlier.push_back(outlier);
  }
  return scene;
}

void check_scenes(SceneOptions options, double max_rotation, double max_translation) {
  for (options.seed = 0; options.seed < 20; ++options.seed) {
    const Scene scene = make_scene(options);
    const auto found = scene.solve();
    REQUIRE(found);
    CHECK(pose_scene::rotation_error(found->cam_from_world, scene.truth) < max_rotation);
    CHECK(pose_scene::translation_error(found->cam_from_world, scene.truth) < max_translation);
    int good = 0, kept = 0, wrong = 0;
    for (std::size_t i = 0; i < scene.is_outlier.size(); ++i) {
      good += !scene.is_outlier[i];
      kept += !scene.is_outlier[i] && found->inlier[i];
      wrong += scene.is_outlier[i] && found->inlier[i];
    }
    CHECK(kept > 0.8 * good);
    CHECK(wrong <= 2);
    CHECK(found->inliers == kept + wrong);
  }
}

TEST_CASE("PnP finds the pose of a pinhole camera among 50 % outliers", "[pose]") {
  check_scenes({}, 0.004, 0.02);
}

TEST_CASE("PnP finds the pose of a fisheye with rays beyond 90 degrees", "[pose]") {
  check_scenes({.max_angle = 1.9}, 0.002, 0.02);
}

TEST_CASE("PnP uses rays that all point backwards", "[pose]") {
  Scene scene = make_scene({.count = 400, .max_angle = 2.2, .outlier_share = 0, .seed = 3});
  Scene backwards{scene.truth, {}, {}, {}, {}};
  for (std::size_t i = 0; i < scene.bearings.size(); ++i) {
    if (scene.bearings[i].z() > -0.05) continue;
    backwards.bearings.push_back(scene.bearings[i]);
    backwards.points.push_back(scene.points[i]);
    backwards.sigma.push_back(scene.sigma[i]);
  }
  REQUIRE(backwards.bearings.size() > 50);
  const auto found = backwards.solve();
  REQUIRE(found);
  CHECK(pose_scene::rotation_error(found->cam_from_world, scene.truth) < 0.002);
  CHECK(found->inliers > 0.9 * static_cast<double>(backwards.bearings.size()));
}

TEST_CASE("PnP finds the pose over a plane", "[pose]") {
  check_scenes({.planar = true}, 0.004, 0.03);
}

TEST_CASE("PnP without noise is exact", "[pose]") {
  Scene scene = make_scene({.outlier_share = 0.3, .sigma = 0});
  scene.sigma.assign(scene.bearings.size(), 1e-5);
  const auto found = scene.solve();
  REQUIRE(found);
  CHECK(pose_scene::rotation_error(found->cam_from_world, scene.truth) < 1e-7);
  CHECK(pose_scene::translation_error(found->cam_from_world, scene.truth) < 1e-7);
}

TEST_CASE("PnP weighs bearings by their standard deviation", "[pose]") {
  // The same scene with half of the bearings ten times as uncertain, and said to be so.
  Scene scene = make_scene({.count = 200, .outlier_share = 0, .sigma = 0.0002, .seed = 5});
  Random random(11);
  for (std::size_t i = 0; i < scene.bearings.size(); i += 2) {
    scene.bearings[i] = (scene.bearings[i] + 0.01 * random.direction()).normalized();
    scene.sigma[i] = 0.01;
  }
  const auto weighted = scene.solve();
  REQUIRE(weighted);
  CHECK(weighted->inliers > 180);
  CHECK(pose_scene::rotation_error(weighted->cam_from_world, scene.truth) < 2e-4);
}

TEST_CASE("PnP repeats itself for the same seed", "[pose]") {
  const Scene scene = make_scene({.outlier_share = 0.6, .seed = 8});
  for (const std::uint64_t seed : {0u, 1u, 77u}) {
    const auto first = scene.solve({.seed = seed});
    const auto second = scene.solve({.seed = seed});
    REQUIRE(first);
    REQUIRE(second);
    CHECK(first->cam_from_world.params == second->cam_from_world.params);
    CHECK(first->inlier == second->inlier);
  }
}

TEST_CASE("PnP finds nothing where there is nothing", "[pose]") {
  CHECK_FALSE(make_scene({.outlier_share = 1}).solve());
  const Scene scene = make_scene({.count = 12, .outlier_share = 0});
  CHECK_FALSE(scene.solve({.min_inliers = 13}));
  for (const std::size_t count : {0u, 1u, 2u}) {
    const std::span bearings(scene.bearings.data(), count);
    const std::span points(scene.points.data(), count);
    const std::span sigma(scene.sigma.data(), count);
    CHECK_FALSE(solve_pnp_ransac(bearings, points, sigma, {.min_inliers = 0}));
  }
}

TEST_CASE("PnP refuses input that leaves the pose open", "[pose]") {
  Scene line = make_scene({.count = 30, .outlier_share = 0});
  Scene place = line;
  Scene broken = line;
  for (std::size_t i = 0; i < line.points.size(); ++i) {
    const Eigen::Vector3d on_line(0.1 * static_cast<double>(i) - 1, 0.5, 5);
    line.points[i] = inverse(line.truth) * on_line;
    line.bearings[i] = on_line.normalized();
    place.points[i] = place.points[0];
    place.bearings[i] = place.bearings[0];
    broken.points[i].x() = std::numeric_limits<double>::quiet_NaN();
  }
  CHECK_FALSE(line.solve());
  CHECK_FALSE(place.solve());
  CHECK_FALSE(broken.solve());
}

TEST_CASE("PnP leaves out what is not finite", "[pose]") {
  Scene scene = make_scene({.outlier_share = 0});
  scene.points[3].x() = std::numeric_limits<double>::quiet_NaN();
  scene.bearings[4].y() = std::numeric_limits<double>::quiet_NaN();
  scene.sigma[5] = 0;
  const auto found = scene.solve();
  REQUIRE(found);
  CHECK(found->inlier[3] == 0);
  CHECK(found->inlier[4] == 0);
  CHECK(found->inlier[5] == 0);
  CHECK(pose_scene::rotation_error(found->cam_from_world, scene.truth) < 0.002);
}

TEST_CASE("PnP refuses unequal input", "[pose]") {
  Scene scene = make_scene({});
  scene.sigma.pop_back();
  CHECK_THROWS_AS(scene.solve(), std::invalid_argument);
}

}  // namespace
}  // namespace hybrid_slam
