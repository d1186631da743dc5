#include "frontend/mapping/epipolar_band.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

struct Ray {
  Eigen::Vector3d bearing;
  double variance = 0;
};

std::vector<Ray> random_rays(std::size_t count, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> sigma(1e-4, 1e-2);  // [rad]
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d any(normal(random), normal(random), normal(random));
    const double one = sigma(random);
    rays.push_back({any.normalized(), one * one});
  }
  return rays;
}

// How far the ray is off the plane, over half the width of the band there.
double share_of_band(const Ray& ray, const Eigen::Vector3d& normal, double variance,
                     double factor) {
  return std::abs(normal.dot(ray.bearing)) / std::sqrt(factor * (ray.variance + variance));
}

TEST_CASE("All rays near an epipolar plane are found, and none that are clearly off it") {
  std::mt19937 random(5);
  const double factor = 2.5 * 2.5;
  const double variance = 1e-6;
  std::size_t in_band = 0;
  for (const std::size_t count : {0, 1, 15, 16, 17, 1000}) {
    const std::vector<Ray> rays = random_rays(count, random);
    EpipolarBand band;
    for (const Ray& ray : rays) band.add(ray.bearing, ray.variance);
    for (const Ray& plane : random_rays(50, random)) {
      std::vector<std::uint32_t> found{7, 7, 7};  // what it held before is of no account
      band.find(plane.bearing, variance, factor, found);
      REQUIRE(std::is_sorted(found.begin(), found.end()));
      std::vector<char> is_found(count, 0);
      for (const std::uint32_t i : found) is_found.at(i) = 1;
      for (std::size_t i = 0; i < count; ++i) {
        const double share = share_of_band(rays[i], plane.bearing, variance, factor);
        if (share <= 1) REQUIRE(is_found[i] != 0);
        if (share > 1.02) REQUIRE(is_found[i] == 0);
        in_band += share <= 1 ? 1 : 0;
      }
    }
  }
  CHECK(in_band > 500);
}

}  // namespace
}  // namespace hybrid_slam
