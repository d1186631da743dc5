#include "frontend/odometry/stereo_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Scene {
  Calibrated<RectifiedStereo> camera = pose_scene::stereo();
  Rigid3d truth;  // current_from_previous
  std::vector<StereoCorrespondence> correspondences;
  std::vector<char> is_outlier;

  auto solve(const StereoOdometerOptions& options = {}) const {
    return solve_stereo_motion(camera, correspondences, options);
  }
};

struct SceneOptions {
  int count = 300;
  double outlier_share = 0;
  double noise = 0;  // standard deviation of each coordinate [px]
  double angle = 0.1;
  double distance = 0.5;
  std::uint64_t seed = 0;
};

Scene make_scene(const SceneOptions& options) {
  Random random(options.seed);
  Scene scene;
  scene.truth = random.rigid(options.distance, options.angle);
  const double* params = scene.camera.params.data();
  while (static_cast<int>(scene.correspondences.size()) < options.count) {
    const Eigen::Vector3d point(random.uniform(-15, 15), random.uniform(-5, 5),
                                random.uniform(3, 25));
    const Eigen::Vector3d moved = scene.truth * point;
    Eigen::Vector3d before, after;
    if (!RectifiedStereo::project(params, point.data(), before.data())) continue;
    if (!RectifiedStereo::project(params, moved.data(), after.data())) continue;
    if (!in_image(scene.camera, before.head<2>()) || !in_image(scene.camera, after.head<2>())) {
      continue;
    }
    StereoCorrespondence c{before, {after[0], after[1], after[2], after[1]}};
    for (int k = 0; k < 3; ++k) c.previous[k] += options.noise * random.gaussian();
    for (int k = 0; k < 4; ++k) c.current[k] += options.noise * random.gaussian();
    const bool outlier = random.uniform(0, 1) < options.outlier_share;
    if (outlier) {
      const double u = random.uniform(0, 1226), v = random.uniform(0, 370);
      c.current = {u, v, u - random.uniform(1, 100), v};
    }
    scene.correspondences.push_back(c);
    scene.is_outlier.push_back(outlier);
  }
  return scene;
}

TEST_CASE("stereo motion is exact without noise, large motions included", "[odometry]") {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Scene scene = make_scene({.angle = 0.7, .distance = 3, .seed = seed});
    const auto found = scene.solve();
    REQUIRE(found);
    CHECK(found->inliers.size() == 300);
    CHECK(pose_scene::rotation_error(found->current_from_previous, scene.truth) < 1e-7);
    CHECK((found->current_from_previous.translation() - scene.truth.translation()).norm() < 1e-7);
  }
}

TEST_CASE("stereo motion survives 40 % outliers", "[odometry]") {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Scene scene = make_scene(
        {.outlier_share = 0.4, .noise = 0.3, .angle = 0.4, .distance = 0.5, .seed = seed});
    const auto found = scene.solve();
    REQUIRE(found);
    CHECK(pose_scene::rotation_error(found->current_from_previous, scene.truth) < 0.002);
    CHECK((found->current_from_previous.translation() - scene.truth.translation()).norm() < 0.03);
    CHECK(std::is_sorted(found->inliers.begin(), found->inliers.end()));
    int wrong = 0;
    for (const int i : found->inliers) wrong += scene.is_outlier[static_cast<std::size_t>(i)];
    CHECK(wrong == 0);
    CHECK(found->inliers.size() > 120);
  }
}

// The cost that VISO2 minimises, written down once more.
double weighted_cost(const Scene& scene, const std::vector<int>& inliers, const Rigid3d& motion) {
  const auto& [fx, fy, cx, cy, base] = scene.camera.params;
  double cost = 0;
  for (const int i : inliers) {
    const StereoCorrespondence& c = scene.correspondences[static_cast<std::size_t>(i)];
    const double z = fx * base / (c.previous[0] - c.previous[2]);
    const Eigen::Vector3d p =
        motion * Eigen::Vector3d(z * (c.previous[0] - cx) / fx, z * (c.previous[1] - cy) / fy, z);
    const double u = fx * p.x() / p.z() + cx;
    const double v = fy * p.y() / p.z() + cy;
    const Eigen::Vector4d predicted(u, v, u - fx * base / p.z(), v);
    const double weight = 1 / (std::abs(c.current[0] - cx) / cx + 0.05);
    cost += weight * weight * (predicted - c.current).squaredNorm();
  }
  return cost;
}

TEST_CASE("stereo motion minimises the weighted reprojection error", "[odometry]") {
  const Scene scene = make_scene({.outlier_share = 0.2, .noise = 0.3, .seed = 4});
  const auto found = scene.solve();
  REQUIRE(found);
  const auto cost = [&](const Vector6d& delta) {
    return weighted_cost(scene, found->inliers, se3_exp(delta) * found->current_from_previous);
  };
  const double at_solution = cost(Vector6d::Zero());
  for (int axis = 0; axis < 6; ++axis) {
    // How far from the solution the parabola through three points has its minimum.
    const double h = 1e-4;
    const Vector6d step = h * Vector6d::Unit(axis);
    const double ahead = cost(step), behind = cost(-step);
    const double curvature = ahead + behind - 2 * at_solution;
    CHECK(curvature > 0);
    CHECK(std::abs(h * (behind - ahead) / (2 * curvature)) < 1e-6);
  }
}

TEST_CASE("stereo motion without noise needs six points and no more", "[odometry]") {
  int found_count = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Scene six = make_scene({.count = 6, .seed = seed});
    const auto found = six.solve();
    REQUIRE(found);
    found_count += pose_scene::rotation_error(found->current_from_previous, six.truth) < 1e-6;
    CHECK_FALSE(make_scene({.count = 5, .seed = seed}).solve());
  }
  CHECK(found_count == 20);
  CHECK_FALSE(Scene{}.solve());
}

TEST_CASE("stereo motion leaves out what cannot be triangulated", "[odometry]") {
  Scene scene = make_scene({.count = 60, .seed = 3});
  const auto clean = scene.solve();
  REQUIRE(clean);
  const StereoCorrespondence good = scene.correspondences[0];
  const std::size_t first = 10;
  std::vector<StereoCorrespondence> bad(6, good);
  bad[0].previous[2] = bad[0].previous[0];      // no disparity
  bad[1].previous[2] = bad[1].previous[0] + 2;  // negative
  bad[2].previous[1] = kNone;
  bad[3].current[3] = kNone;
  bad[4].current[2] = bad[4].current[0];
  bad[5].previous[0] = std::numeric_limits<double>::infinity();
  scene.correspondences.insert(scene.correspondences.begin() + first, bad.begin(), bad.end());
  const auto found = scene.solve();
  REQUIRE(found);
  CHECK(found->inliers.size() == 60);
  for (const int i : found->inliers) {
    CHECK((static_cast<std::size_t>(i) < first || static_cast<std::size_t>(i) >= first + 6));
  }
  CHECK(pose_scene::rotation_error(found->current_from_previous, scene.truth) < 1e-7);
}

TEST_CASE("stereo motion refuses what leaves the motion open", "[odometry]") {
  CHECK_FALSE(make_scene({.count = 100, .outlier_share = 1}).solve());
  Scene same = make_scene({.count = 50});
  std::fill(same.correspondences.begin(), same.correspondences.end(), same.correspondences[0]);
  CHECK_FALSE(same.solve());
  Scene nothing = make_scene({.count = 50});
  for (StereoCorrespondence& c : nothing.correspondences) c.current.setConstant(kNone);
  CHECK_FALSE(nothing.solve());
}

TEST_CASE("stereo motion repeats itself for the same seed", "[odometry]") {
  const Scene scene = make_scene({.outlier_share = 0.4, .noise = 0.5, .seed = 12});
  const auto first = scene.solve({.seed = 5});
  const auto second = scene.solve({.seed = 5});
  REQUIRE(first);
  REQUIRE(second);
  CHECK(first->current_from_previous.params == second->current_from_previous.params);
  CHECK(first->inliers == second->inliers);
}

// Normalised squared errors of many motions, by the covariance that comes with each.
std::vector<double> normalized_errors(SceneOptions options, int runs) {
  std::vector<double> errors;
  for (int run = 0; run < runs; ++run) {
    options.seed = static_cast<std::uint64_t>(run);
    const Scene scene = make_scene(options);
    const auto found = scene.solve({.ransac_iterations = 50});
    REQUIRE(found);
    const Vector6d off = se3_log(found->current_from_previous * inverse(scene.truth));
    errors.push_back(squared_mahalanobis(off, found->covariance));
  }
  return errors;
}

TEST_CASE("stereo motion knows how far it may be off") {
  // Mean of chi2 over its 6 degrees of freedom, over 400 runs: 1 with a standard deviation of 0.03.
  for (const SceneOptions& options :
       {SceneOptions{.count = 300, .noise = 0.3}, SceneOptions{.count = 300, .noise = 0.05},
        SceneOptions{.count = 60, .noise = 0.3, .angle = 0.02, .distance = 0.2},
        SceneOptions{.count = 300, .outlier_share = 0.3, .noise = 0.2, .distance = 1},
        SceneOptions{.count = 30, .noise = 0.2}}) {
    const std::vector<double> errors = normalized_errors(options, 400);
    const double mean =
        std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
    INFO(options.count << " points, noise " << options.noise << " px, up to " << options.distance
                       << " m");
    CHECK(mean / 6 > 0.8);
    CHECK(mean / 6 < 1.2);
    // Median of chi2 with 6 degrees of freedom: 5.35.
    std::vector<double> sorted = errors;
    std::nth_element(sorted.begin(), sorted.begin() + 200, sorted.end());
    CHECK(sorted[200] / 5.348 > 0.8);
    CHECK(sorted[200] / 5.348 < 1.2);
  }
}

TEST_CASE("the covariance of a stereo motion is there without noise, too, and repeats itself") {
  const Scene scene = make_scene({.count = 40});
  const auto found = scene.solve();
  REQUIRE(found);
  CHECK(found->covariance == found->covariance.transpose());
  CHECK(found->covariance.llt().info() == Eigen::Success);
  CHECK(found->covariance.diagonal().maxCoeff() < 1e-6);
  CHECK(found->covariance == scene.solve()->covariance);
}

TEST_CASE("stereo motion's options are checked", "[odometry]") {
  CHECK(StereoOdometerOptions{}.validate().empty());
  CHECK_FALSE(StereoOdometerOptions{.ransac_iterations = 0}.validate().empty());
  CHECK_FALSE(StereoOdometerOptions{.inlier_threshold = 0}.validate().empty());
  CHECK_FALSE(StereoOdometerOptions{.inlier_threshold = kNone}.validate().empty());
  CHECK_FALSE(StereoOdometerOptions{.min_inliers = 2}.validate().empty());
  CHECK_FALSE(StereoOdometerOptions{.max_gauss_newton_iterations = 0}.validate().empty());
}

}  // namespace
}  // namespace hybrid_slam
