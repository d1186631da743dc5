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

constexpr FoundParameter kStart{1.2, 0.03, 0.05, 1.18};

// 64 measurements with this noise, which they tell.
RunningEstimate started(double value, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> error(0, noise);
  RunningEstimate estimate(1, 1, 3, kStart);
  for (int i = 0; i < 64; ++i) estimate.add(value + error(random), 1 / (noise * noise));
  return estimate;
}

TEST_CASE("an estimate begins with what an earlier run has found", "[running_estimate]") {
  CHECK_FALSE(RunningEstimate(1, 1, 3).found());
  RunningEstimate estimate(1, 1, 3, kStart);
  CHECK(estimate.in_use() == 1.18);
  CHECK(estimate.found() == kStart);
  // Of less weight than the start: what is in use hardly changes, and stays in use.
  estimate.add(1.0, 1 / (0.1 * 0.1));
  const double weight = 100 / (1 / (0.03 * 0.03) + 100);
  CHECK(estimate.value_now() == Approx(1.2 - weight * 0.2).epsilon(0.002));
  CHECK(estimate.in_use() == estimate.value_now());
  // The noise averages out, what shifts all alike does not.
  const auto found = started(1.2, 0.1, 1).found();
  CHECK(found->sigma == Approx(1 / std::sqrt(0.93 / (0.03 * 0.03) + 62 / 0.01)).epsilon(0.1));
  CHECK(found->systematic < 0.05);
}

TEST_CASE("measurements that agree with an earlier run's do not contradict it",
          "[running_estimate]") {
  for (unsigned seed = 0; seed < 500; ++seed) {
    const RunningEstimate estimate = started(1.2 + (seed % 2 == 0 ? 0.05 : -0.05), 0.1, seed);
    CHECK_FALSE(estimate.contradicts_start());
    CHECK(estimate.in_use() == Approx(1.2).margin(0.15));
  }
}

TEST_CASE("measurements that contradict an earlier run win", "[running_estimate]") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const RunningEstimate repaired = started(0, 0.1, seed);
    CHECK(repaired.contradicts_start());
    CHECK(repaired.value_now() == Approx(0).margin(4 * 0.1 / 8));
    CHECK(std::abs(repaired.in_use()) < 4 * 0.1 / 8);
    const RunningEstimate knocked = started(2, 0.1, seed);
    CHECK(knocked.contradicts_start());
    CHECK(knocked.in_use() == Approx(2).margin(4 * 0.1 / 8));
  }
}

}  // namespace
}  // namespace hybrid_slam
