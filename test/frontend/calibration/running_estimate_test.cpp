#include "frontend/calibration/running_estimate.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <set>

namespace hybrid_slam {
namespace {

TEST_CASE("an estimate is used from where it is shown, with few values", "[running_estimate]") {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.1);
  RunningEstimate estimate(1, 1, 3);
  std::set<double> used;
  for (int i = 0; i < 500; ++i) {
    estimate.add(0.2 + noise(random), 1 / (0.1 * 0.1));
    used.insert(estimate.in_use());
  }
  CHECK(estimate.in_use() == Approx(0.2).margin(4 * 0.1 / 16));
  CHECK(estimate.sigma() == Approx(0.1 / std::sqrt(400.0)).epsilon(0.2));  // some is forgotten
  CHECK(used.size() <= 10);                                                // 9 times doubled, and 0
}

TEST_CASE("measurements that scatter more than they promise show less", "[running_estimate]") {
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, 1);
  RunningEstimate estimate(1, 1, 3);
  for (int i = 0; i < 64; ++i) estimate.add(0.1 + noise(random), 1 / (0.1 * 0.1));
  CHECK(estimate.sigma() == Approx(1 / 8.0).epsilon(0.3));
  CHECK(estimate.in_use() == 0);
}

TEST_CASE("what lies long back is forgotten, slowly", "[running_estimate]") {
  RunningEstimate estimate(1, 1, 3);
  for (int i = 0; i < 1000; ++i) estimate.add(0, 100);
  for (int i = 0; i < 3100; ++i) estimate.add(1, 100);
  CHECK(estimate.value_now() > 0.9);
  for (int i = 0; i < 30; ++i) estimate.add(0, 100);
  CHECK(estimate.value_now() > 0.9);
}

TEST_CASE("what shifts all measurements alike does not average out", "[running_estimate]") {
  RunningEstimate estimate(1, 1, 3);
  for (int i = 0; i < 512; ++i) estimate.add(0.2, 1e4, 0.1);
  CHECK(estimate.sigma() == Approx(0.1).epsilon(0.05));
  CHECK(estimate.in_use() == 0);
}

}  // namespace
}  // namespace hybrid_slam
