#include "frontend/pose/pose_belief.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "frontend/pose/pnp_ransac.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

PoseSupport support(int candidates, int inliers, double chance) {
  return {.candidates = candidates, .inliers = inliers, .evidence = inliers, .chance = chance};
}

TEST_CASE("The number of false alarms is that of its definition") {
  // (10 - 3) C(10, 6) C(6, 3) 0.01^3 = 7 * 210 * 20 * 1e-6.
  CHECK(log10_false_alarms(support(10, 6, 0.01)) == Approx(std::log10(0.0294)));
  CHECK(std::isinf(log10_false_alarms(support(10, 3, 0.01))));
  CHECK(std::isinf(log10_false_alarms(support(0, 0, 0.01))));
}

TEST_CASE("Few matches that agree closely are no accident; many that had to agree are") {
  CHECK(is_no_accident(support(20, 9, 1e-4)));
  CHECK_FALSE(is_no_accident(support(20, 5, 1e-4)));
  CHECK_FALSE(is_no_accident(support(400, 120, 0.3)));
  CHECK(is_no_accident(support(400, 390, 0.3)));
}

// Matches all over the image that are all wrong: the pose that RANSAC finds best in them.
TEST_CASE("Poses of wrong matches are not believed") {
  const auto camera = pose_scene::stereo();
  const double area = static_cast<double>(camera.width) * camera.height;
  double nearest = 100;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    std::vector<PoseObservation> observations;
    for (int i = 0; i < 20 + 10 * static_cast<int>(seed % 8); ++i) {
      observations.push_back(
          {{random.uniform(-5, 5), random.uniform(-3, 3), random.uniform(4, 20)},
           {random.uniform(0, camera.width), random.uniform(0, camera.height), std::nan("")},
           3.0});
    }
    const auto found = solve_pnp_ransac(bearing_observations(camera, observations),
                                        {.max_iterations = 1000, .min_inliers = 4});
    if (!found) continue;
    const double alarms = log10_false_alarms(support(
        static_cast<int>(observations.size()), found->inliers, chance_in_area(3.0, 5.991, area)));
    nearest = std::min(nearest, alarms);
  }
  CHECK(nearest > -2);  // one of 60 has fewer than 1 / 60 on average
  CHECK(nearest < 3);   // the bound is not idle
}

TEST_CASE("A place is certain by its least certain direction") {
  Matrix6d covariance = Matrix6d::Identity() * 1e-6;
  CHECK(is_certain(covariance, 1));
  covariance(2, 2) = 9e-4;
  CHECK(translation_sigma(covariance) == Approx(0.03));
  CHECK_FALSE(is_certain(covariance, 1));
  CHECK(is_certain(covariance, 2));
  CHECK_FALSE(is_believed(support(100, 90, 1e-3)));  // nothing known of how certain
}

}  // namespace
}  // namespace hybrid_slam
