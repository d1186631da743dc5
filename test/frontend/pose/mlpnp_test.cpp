#include "frontend/pose/mlpnp.h"

#include <catch2/catch.hpp>

#include "test/frontend/pose/pnp_scene.h"
#include "test/frontend/pose/pose_scene.h"

namespace hybrid_slam {
namespace {

using pose_scene::kNaN;
using pose_scene::make_pnp_scene;
using pose_scene::PnpScene;
using pose_scene::PnpSceneOptions;
using pose_scene::rotation_error;
using pose_scene::translation_error;

std::vector<BearingObservation> bearings_of(const PnpScene& scene) {
  return bearing_observations(scene.camera, scene.observations);
}

const PnpSceneOptions kInSpace{.camera = pose_scene::pinhole()};
const PnpSceneOptions kFisheyeInSpace{.camera = pose_scene::fisheye()};
const PnpSceneOptions kBeyond{.camera = pose_scene::fisheye(), .min_angle = 1.58};
const PnpSceneOptions kPlane{.camera = pose_scene::pinhole(), .planar = true};
const PnpSceneOptions kFisheyePlane{.camera = pose_scene::fisheye(), .planar = true};
const PnpSceneOptions kThinPlane{
    .camera = pose_scene::pinhole(), .planar = true, .thickness = 0.03};
const PnpSceneOptions kSceneKinds[] = {kInSpace, kFisheyeInSpace, kBeyond,
                                       kPlane,   kFisheyePlane,   kThinPlane};

TEST_CASE("A bearing's residual is the pixel's error over its standard deviation", "[pose]") {
  for (const Camera& camera : {Camera(pose_scene::pinhole()), Camera(pose_scene::stereo()),
                               Camera(pose_scene::fisheye())}) {
    const PnpScene scene = make_pnp_scene({.camera = camera, .count = 50, .sigma = 0.7});
    const auto observed = bearings_of(scene);
    for (std::size_t i = 0; i < observed.size(); ++i) {
      const Eigen::Vector2d pixel = scene.observations[i].measurement.head<2>();
      const Eigen::Vector2d error(1e-4, -2e-4);
      const auto direction = unproject(camera, pixel + error);
      REQUIRE(direction);
      CHECK((observed[i].whitening * observed[i].bearing).norm() < 1e-9);
      CHECK((observed[i].whitening * *direction - error / 0.7).norm() < 1e-6);
    }
  }
}

TEST_CASE("What has no bearing is not usable", "[pose]") {
  const Camera camera = pose_scene::fisheye();
  const Eigen::Vector3d point(1, 2, 3);
  const PoseObservation good{point, {500, 600, kNaN}, 1};
  PoseObservation sigma = good, pixel = good, place = good, outside = good;
  sigma.sigma = 0;
  pixel.measurement.y() = kNaN;
  place.point_in_world.z() = kNaN;
  outside.measurement.x() = 1e6;  // beyond the model's range
  const auto observed =
      bearing_observations(camera, std::vector{good, sigma, pixel, place, outside});
  REQUIRE(observed.size() == 5);
  CHECK(observed[0].is_usable());
  for (std::size_t i = 1; i < 5; ++i) CHECK_FALSE(observed[i].is_usable());
}

TEST_CASE("MLPnP without noise is exact", "[pose]") {
  for (PnpSceneOptions options : kSceneKinds) {
    options.sigma = 1e-7;
    for (const int count : {6, 7, 30}) {
      options.count = count;
      const PnpScene scene = make_pnp_scene(options);
      const auto found = solve_mlpnp(bearings_of(scene));
      REQUIRE(found);
      CHECK(rotation_error(*found, scene.truth) < 1e-6);
      CHECK(translation_error(*found, scene.truth) < 1e-5);
    }
  }
}

TEST_CASE("MLPnP does with four points in a plane", "[pose]") {
  PnpSceneOptions options = kPlane;
  options.count = 4;
  options.sigma = 1e-4;
  for (options.seed = 0; options.seed < 20; ++options.seed) {
    const PnpScene scene = make_pnp_scene(options);
    const auto found = solve_mlpnp(bearings_of(scene));
    REQUIRE(found);
    CHECK(translation_error(*found, scene.truth) < 0.01);
  }
}

TEST_CASE("MLPnP finds the least of all minima", "[pose]") {
  for (PnpSceneOptions options : kSceneKinds) {
    for (const int count : {6, 9, 40}) {
      options.count = count;
      for (const double sigma : {0.5, 2.0}) {
        options.sigma = sigma;
        int worse = 0;
        for (options.seed = 0; options.seed < 50; ++options.seed) {
          const PnpScene scene = make_pnp_scene(options);
          const auto observed = bearings_of(scene);
          const auto found = solve_mlpnp(observed);
          const auto next_to_truth = refine_on_bearings(observed, scene.truth);
          REQUIRE(next_to_truth);
          worse += !found || bearing_cost(observed, *found) >
                                 1e-9 + (1 + 1e-6) * bearing_cost(observed, *next_to_truth);
        }
        INFO(model_name(options.camera) << ", " << count << " points, " << sigma << " px");
        CHECK(worse == 0);
      }
    }
  }
}

// The cost of the best pose is distributed as chi2 with 2 n - 6 degrees of freedom.
TEST_CASE("MLPnP's residuals have the covariance that was given", "[pose]") {
  for (PnpSceneOptions options : {kInSpace, kFisheyeInSpace, kBeyond, kPlane}) {
    options.count = 40;
    options.sigma = 0.3;
    options.max_sigma = 2;
    double cost = 0;
    for (options.seed = 0; options.seed < 100; ++options.seed) {
      const PnpScene scene = make_pnp_scene(options);
      const auto observed = bearings_of(scene);
      const auto found = solve_mlpnp(observed);
      REQUIRE(found);
      cost += bearing_cost(observed, *found) / 100;
    }
    CHECK(cost == Approx(2 * 40 - 6).margin(5));  // its standard deviation is 1.2
  }
}

TEST_CASE("MLPnP agrees with the least squares of pixels", "[pose]") {
  for (PnpSceneOptions options : kSceneKinds) {
    options.sigma = 0.5;
    for (options.seed = 0; options.seed < 10; ++options.seed) {
      const PnpScene scene = make_pnp_scene(options);
      const auto found = solve_mlpnp(bearings_of(scene));
      const auto pixels = refine_pose(scene.camera, scene.truth, scene.observations,
                                      {.robust_rounds = 0, .chi2_mono = 1e9});
      REQUIRE(found);
      REQUIRE(pixels.inliers == options.count);
      const double least = pixels.rms * pixels.rms * 2 * options.count;
      const auto at_found = refine_pose(scene.camera, *found, scene.observations,
                                        {.rounds = 1, .iterations = 0, .chi2_mono = 1e9});
      const double ours = at_found.rms * at_found.rms * 2 * options.count;
      CHECK(ours < least + 0.1);  // an error of one standard deviation adds 1
    }
  }
}

TEST_CASE("MLPnP weighs bearings by their covariance", "[pose]") {
  PnpSceneOptions options = kFisheyeInSpace;
  options.count = 30;
  options.sigma = 0.2;
  options.max_sigma = 3;
  double weighted = 0, unweighted = 0;
  for (options.seed = 0; options.seed < 100; ++options.seed) {
    PnpScene scene = make_pnp_scene(options);
    const auto with = solve_mlpnp(bearings_of(scene));
    for (PoseObservation& o : scene.observations) o.sigma = 1;
    const auto without = solve_mlpnp(bearings_of(scene));
    REQUIRE(with);
    REQUIRE(without);
    weighted += rotation_error(*with, scene.truth);
    unweighted += rotation_error(*without, scene.truth);
  }
  CHECK(weighted < 0.7 * unweighted);
}

TEST_CASE("MLPnP refines a guess from three points", "[pose]") {
  PnpSceneOptions options = kInSpace;
  options.count = 3;
  options.sigma = 1e-7;
  const PnpScene scene = make_pnp_scene(options);
  CHECK_FALSE(solve_mlpnp(bearings_of(scene)));
  const Rigid3d guess =
      Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitY())),
              {0.05, -0.02, 0.05}) *
      scene.truth;
  const auto found = solve_mlpnp(bearings_of(scene), &guess);
  REQUIRE(found);
  CHECK(rotation_error(*found, scene.truth) < 1e-6);
}

TEST_CASE("MLPnP finds nothing where the pose is open", "[pose]") {
  const PnpScene scene = make_pnp_scene(kInSpace);
  const auto all = bearings_of(scene);
  for (std::size_t count = 0; count < 6; ++count) {
    CHECK_FALSE(solve_mlpnp(std::span(all).first(count)));
  }
  auto one_place = all;
  for (auto& o : one_place) o = all[0];
  CHECK_FALSE(solve_mlpnp(one_place));
  auto not_finite = all;
  not_finite[7].point_in_world.y() = kNaN;
  CHECK_FALSE(solve_mlpnp(not_finite));
  not_finite = all;
  not_finite[7].bearing.y() = kNaN;
  not_finite[7].whitening(0, 0) = kNaN;
  CHECK_FALSE(solve_mlpnp(not_finite));

  std::vector<PoseObservation> line;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d point(0.1 * i - 1, 0.5, 5);
    const auto pixel = project(scene.camera, point);
    line.push_back({inverse(scene.truth) * point, {pixel->x(), pixel->y(), kNaN}, 1});
  }
  CHECK_FALSE(solve_mlpnp(bearing_observations(scene.camera, line)));
}

}  // namespace
}  // namespace hybrid_slam
