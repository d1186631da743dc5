#include "frontend/pose/pnp_ransac.h"

#include <catch2/catch.hpp>

#include "test/frontend/pose/pnp_scene.h"
#include "test/frontend/pose/pose_scene.h"

namespace hybrid_slam {
namespace {

using pose_scene::kNaN;
using pose_scene::make_pnp_scene;
using pose_scene::PnpScene;
using pose_scene::PnpSceneOptions;

const PnpSceneOptions kPinhole{.camera = pose_scene::pinhole(), .outlier_share = 0.5};
const PnpSceneOptions kFisheye{.camera = pose_scene::fisheye(), .outlier_share = 0.5};

std::optional<PnpResult> solve(const PnpScene& scene, const PnpRansacOptions& options = {}) {
  return solve_pnp_ransac(bearing_observations(scene.camera, scene.observations), options);
}

void check_scenes(PnpSceneOptions options, double max_rotation, double max_translation,
                  const PnpRansacOptions& ransac = {}) {
  for (options.seed = 0; options.seed < 20; ++options.seed) {
    const PnpScene scene = make_pnp_scene(options);
    const auto found = solve(scene, ransac);
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
  PnpSceneOptions options = kPinhole;
  options.sigma = 0.5;
  check_scenes(options, 0.002, 0.02);
  options.sigma = 2;
  check_scenes(options, 0.008, 0.08);
}

TEST_CASE("PnP finds the pose of a fisheye among 50 % outliers", "[pose]") {
  check_scenes(kFisheye, 0.004, 0.03);
}

TEST_CASE("PnP uses rays that all lie beyond 90 degrees", "[pose]") {
  PnpSceneOptions options = kFisheye;
  options.min_angle = 1.58;
  check_scenes(options, 0.004, 0.03);
}

TEST_CASE("PnP finds the pose over a plane", "[pose]") {
  PnpSceneOptions options = kPinhole;
  options.planar = true;
  check_scenes(options, 0.01, 0.1);
  options = kFisheye;
  options.planar = true;
  check_scenes(options, 0.005, 0.06);
}

// One residual in twenty lies above the threshold and leaves five points, or four.
TEST_CASE("PnP finds the pose from six points", "[pose]") {
  PnpSceneOptions options = kPinhole;
  options.count = 6;
  options.outlier_share = 0;
  options.sigma = 0.5;
  for (options.seed = 0; options.seed < 50; ++options.seed) {
    const PnpScene scene = make_pnp_scene(options);
    const auto found = solve(scene, {.min_inliers = 4});
    REQUIRE(found);
    CHECK(pose_scene::rotation_error(found->cam_from_world, scene.truth) < 0.03);
    CHECK(pose_scene::translation_error(found->cam_from_world, scene.truth) < 0.3);
  }
}

TEST_CASE("PnP without noise is exact", "[pose]") {
  PnpSceneOptions options = kFisheye;
  options.sigma = 1e-6;
  PnpScene scene = make_pnp_scene(options);
  for (PoseObservation& o : scene.observations) o.sigma = 1;
  const auto found = solve(scene);
  REQUIRE(found);
  CHECK(pose_scene::rotation_error(found->cam_from_world, scene.truth) < 1e-6);
  CHECK(pose_scene::translation_error(found->cam_from_world, scene.truth) < 1e-6);
}

TEST_CASE("PnP repeats itself for the same seed", "[pose]") {
  PnpSceneOptions options = kPinhole;
  options.outlier_share = 0.6;
  const PnpScene scene = make_pnp_scene(options);
  for (const std::uint64_t seed : {0u, 1u, 77u}) {
    const auto first = solve(scene, {.seed = seed});
    const auto second = solve(scene, {.seed = seed});
    REQUIRE(first);
    REQUIRE(second);
    CHECK(first->cam_from_world.params == second->cam_from_world.params);
    CHECK(first->inlier == second->inlier);
  }
}

TEST_CASE("PnP finds nothing where there is nothing", "[pose]") {
  PnpSceneOptions options = kPinhole;
  options.outlier_share = 1;
  CHECK_FALSE(solve(make_pnp_scene(options)));
  options.outlier_share = 0;
  options.count = 12;
  const PnpScene scene = make_pnp_scene(options);
  CHECK_FALSE(solve(scene, {.min_inliers = 13}));
  const auto all = bearing_observations(scene.camera, scene.observations);
  for (const std::size_t count : {0u, 1u, 2u}) {
    CHECK_FALSE(solve_pnp_ransac(std::span(all).first(count), {.min_inliers = 0}));
  }
}

TEST_CASE("PnP refuses input that leaves the pose open", "[pose]") {
  PnpSceneOptions options = kPinhole;
  options.outlier_share = 0;
  options.count = 30;
  PnpScene line = make_pnp_scene(options);
  PnpScene place = line;
  PnpScene broken = line;
  for (std::size_t i = 0; i < line.observations.size(); ++i) {
    const Eigen::Vector3d on_line(0.1 * static_cast<double>(i) - 1, 0.5, 5);
    const auto pixel = project(line.camera, on_line);
    line.observations[i] = {inverse(line.truth) * on_line, {pixel->x(), pixel->y(), kNaN}, 1};
    place.observations[i] = place.observations[0];
    broken.observations[i].point_in_world.x() = kNaN;
  }
  CHECK_FALSE(solve(line));
  CHECK_FALSE(solve(place));
  CHECK_FALSE(solve(broken));
}

TEST_CASE("PnP leaves out what is not finite", "[pose]") {
  PnpSceneOptions options = kPinhole;
  options.outlier_share = 0;
  PnpScene scene = make_pnp_scene(options);
  scene.observations[3].point_in_world.x() = kNaN;
  scene.observations[4].measurement.y() = kNaN;
  scene.observations[5].sigma = 0;
  const auto found = solve(scene);
  REQUIRE(found);
  CHECK(found->inlier.size() == scene.observations.size());
  CHECK(found->inlier[3] == 0);
  CHECK(found->inlier[4] == 0);
  CHECK(found->inlier[5] == 0);
  int inliers = 0;
  for (std::size_t i = 0; i < found->inlier.size(); ++i) inliers += found->inlier[i];
  CHECK(inliers == found->inliers);
  CHECK(inliers > 80);
  CHECK(pose_scene::rotation_error(found->cam_from_world, scene.truth) < 0.004);
}

TEST_CASE("PnP refuses options out of range", "[pose]") {
  const PnpScene scene = make_pnp_scene(kPinhole);
  CHECK_THROWS_AS(solve(scene, {.confidence = 1}), std::invalid_argument);
  CHECK_THROWS_AS(solve(scene, {.max_iterations = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace hybrid_slam
