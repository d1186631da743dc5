#include "frontend/pose/relative_pose.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "frontend/pose/direction_residual.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {
namespace {

struct PairsOptions {
  Camera a = synthetic_stereo_camera(0.12);
  Camera b = synthetic_stereo_camera(0.12);
  double scale = 1;  // a_from_b's
  int count = 150;
  double sigma = 0.5;        // [px]
  double point_noise = 0.0;  // [m], of what each side knows of its points
  double outlier_share = 0;
  bool planar = false;
  std::uint64_t seed = 1;
};

struct Pairs {
  Sim3d a_from_b;
  std::vector<PointPair> pairs;
  std::vector<char> wrong;
};

BearingObservation seen(const Camera& camera, const Eigen::Vector3d& known,
                        const Eigen::Vector2d& pixel, double sigma) {
  const PoseObservation observation{known, {pixel.x(), pixel.y(), kNoRightMatch}, sigma};
  return bearing_observations(camera, {&observation, 1}).front();
}

Pairs make_pairs(const PairsOptions& options) {
  Random random(options.seed);
  Vector6d tangent;
  tangent << random.gaussian3(0.4), random.gaussian3(0.15);
  const Rigid3d true_a_from_b = se3_exp(tangent);
  Pairs made;
  // Side a knows everything `scale` times as large.
  made.a_from_b =
      Sim3d(true_a_from_b.rotation(), options.scale * true_a_from_b.translation(), options.scale);
  const auto noisy = [&](const Eigen::Vector2d& pixel) {
    return Eigen::Vector2d(pixel.x() + options.sigma * random.gaussian(),
                           pixel.y() + options.sigma * random.gaussian());
  };
  while (static_cast<int>(made.pairs.size()) < options.count) {
    const double z = options.planar ? 3 : random.uniform(2, 5);
    const Eigen::Vector3d in_b(random.uniform(-2, 2), random.uniform(-1.5, 1.5), z);
    const Eigen::Vector3d in_a = true_a_from_b * in_b;
    const auto pixel_a = project(options.a, in_a);
    const auto pixel_b = project(options.b, in_b);
    if (!pixel_a || !pixel_b || !in_image(options.a, *pixel_a) || !in_image(options.b, *pixel_b)) {
      continue;
    }
    const bool wrong = random.uniform() < options.outlier_share;
    const Eigen::Vector3d known_in_a =
        options.scale * (wrong ? Eigen::Vector3d(random.uniform(-2, 2), random.uniform(-1.5, 1.5),
                                                 random.uniform(2, 5))
                               : Eigen::Vector3d(in_a + random.gaussian3(options.point_noise)));
    const auto place_in_a = wrong ? project(options.a, known_in_a) : pixel_a;
    if (!place_in_a || !in_image(options.a, *place_in_a)) continue;
    made.pairs.push_back({seen(options.a, known_in_a, noisy(*place_in_a), options.sigma),
                          seen(options.b, in_b + random.gaussian3(options.point_noise),
                               noisy(*pixel_b), options.sigma)});
    made.wrong.push_back(wrong ? 1 : 0);
  }
  return made;
}

struct Error {
  double translation = 0;
  double rotation = 0;
  double scale = 0;
};

Error error_of(const Sim3d& estimate, const Sim3d& truth) {
  const Sim3d off = inverse(truth) * estimate;
  return {off.translation().norm(), so3_log(off.rotation()).norm(), std::abs(off.scale() - 1)};
}

RelativePoseOptions options_for(double scale) {
  RelativePoseOptions options;
  options.with_scale = scale != 1;
  return options;
}

TEST_CASE("The motion between two views is found, whatever their cameras and scale") {
  const std::vector<Camera> cameras{synthetic_stereo_camera(0.12), synthetic_fisheye_camera()};
  for (const Camera& a : cameras) {
    for (const Camera& b : cameras) {
      for (const double scale : {1.0, 0.7, 1.5}) {
        PairsOptions options;
        options.a = a;
        options.b = b;
        options.scale = scale;
        options.outlier_share = 0.6;
        options.count = 250;
        const Pairs made = make_pairs(options);
        const auto found = solve_relative_pose_ransac(made.pairs, options_for(scale));
        REQUIRE(found);
        const Error error = error_of(found->a_from_b, made.a_from_b);
        CHECK(error.translation < 0.01);
        CHECK(error.rotation < 0.003);
        CHECK(error.scale < 0.01);
        if (scale == 1) CHECK(found->a_from_b.scale() == 1);
        int right = 0, taken_in = 0;
        for (std::size_t i = 0; i < made.wrong.size(); ++i) {
          right += found->inlier[i] != 0 && made.wrong[i] == 0 ? 1 : 0;
          taken_in += found->inlier[i] != 0 && made.wrong[i] != 0 ? 1 : 0;
        }
        CHECK(right > 80);
        CHECK(taken_in <= 3);
      }
    }
  }
}

TEST_CASE("Points in a plane will do") {
  PairsOptions options;
  options.planar = true;
  options.outlier_share = 0.3;
  const Pairs made = make_pairs(options);
  const auto found = solve_relative_pose_ransac(made.pairs, options_for(1));
  REQUIRE(found);
  CHECK(error_of(found->a_from_b, made.a_from_b).translation < 0.01);
}

TEST_CASE("The error falls with the noise") {
  const auto rms = [](double sigma) {
    double squares = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      PairsOptions options;
      options.sigma = sigma;
      options.seed = seed;
      const Pairs made = make_pairs(options);
      const auto found = solve_relative_pose_ransac(made.pairs, options_for(1));
      REQUIRE(found);
      squares += std::pow(error_of(found->a_from_b, made.a_from_b).translation, 2);
    }
    return std::sqrt(squares / 20);
  };
  const double coarse = rms(1);
  const double fine = rms(0.1);
  // 150 points at 3.5 m, both ways, f = 450 px: sigma / f * 3.5 / sqrt(300), and what turns add.
  CHECK(coarse < 0.005);
  CHECK(fine < 0.15 * coarse);
}

TEST_CASE("Too few, collinear or unusable pairs tell nothing") {
  PairsOptions options;
  options.count = 19;
  CHECK(!solve_relative_pose_ransac(make_pairs(options).pairs, options_for(1)));
  CHECK(!solve_relative_pose_ransac({}, options_for(1)));
  options.count = 60;
  options.outlier_share = 1;
  CHECK(!solve_relative_pose_ransac(make_pairs(options).pairs, options_for(1)));
  std::vector<PointPair> on_line;
  const Camera camera = synthetic_stereo_camera(0.12);
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d point(-1 + 0.05 * i, 0.1, 3);
    const auto one = seen(camera, point, *project(camera, point), 1);
    on_line.push_back({one, one});
  }
  CHECK(!solve_relative_pose_ransac(on_line, options_for(1)));
  options.outlier_share = 0;
  Pairs made = make_pairs(options);
  for (std::size_t i = 0; i < 20; ++i) made.pairs[i].in_a.bearing.x() = std::nan("");
  const auto found = solve_relative_pose_ransac(made.pairs, options_for(1));
  REQUIRE(found);
  CHECK(found->inliers <= 40);
  CHECK(!found->inlier[3]);
}

TEST_CASE("The same pairs and seed give the same bits") {
  PairsOptions options;
  options.outlier_share = 0.5;
  const Pairs made = make_pairs(options);
  const auto once = solve_relative_pose_ransac(made.pairs, options_for(1));
  const auto again = solve_relative_pose_ransac(made.pairs, options_for(1));
  REQUIRE(once);
  CHECK(once->a_from_b.params == again->a_from_b.params);
  CHECK(once->inlier == again->inlier);
}

TEST_CASE("A refinement ends where its gradient is zero") {
  // Numerically, in all seven unknowns: wrong derivatives would end elsewhere.
  PairsOptions options;
  options.scale = 1.2;
  options.sigma = 1;
  const Pairs made = make_pairs(options);
  RelativePoseOptions refinement = options_for(1.2);
  refinement.chi2 = 1e9;  // all are inliers
  const auto found = refine_relative_pose(made.pairs, made.a_from_b, refinement);
  REQUIRE(found);
  const auto cost = [&](const Vector7d& tangent) {
    const Sim3d a_from_b = sim3_exp(tangent) * found->a_from_b;
    double sum = 0;
    for (const PointPair& pair : made.pairs) {
      sum += direction_chi2(pair.in_a, a_from_b * pair.in_b.point_in_world) +
             direction_chi2(pair.in_b, inverse(a_from_b) * pair.in_a.point_in_world);
    }
    return sum;
  };
  for (int i = 0; i < 7; ++i) {
    const Vector7d step = 1e-4 * Vector7d::Unit(i);
    const double slope = (cost(step) - cost(-step)) / 2e-4;
    const double curvature = (cost(step) + cost(-step) - 2 * cost(Vector7d::Zero())) / 1e-8;
    CHECK(curvature > 0);
    CHECK(std::abs(slope / curvature) < 1e-6);
  }
}

}  // namespace
}  // namespace hybrid_slam
