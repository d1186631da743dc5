#include "test/backend/weak_ground.h"

#include <algorithm>

#include <catch2/catch.hpp>

// One keyframe shares few landmarks with the map before it, all of them right. What odometry knows
// of it must not be lost.

namespace hybrid_slam {
namespace {

constexpr int kMaxShared = 10;
constexpr double kQuantile99 = 16.812;   // of chi2, 6 degrees of freedom
constexpr double kOneInAMillion = 38.3;  // likewise

struct Errors {
  std::vector<double> smoothed;
  std::vector<double> adjusted;  // by bundle adjustment of everything after that
};

Errors errors_of(int shared, int runs, bool with_odometry) {
  Errors errors;
  const BackendOptions options;
  for (int run = 0; run < runs; ++run) {
    Backend backend(options);
    const auto seed = static_cast<std::uint64_t>(1000 * shared + run);
    const GrownWeakGround grown({shared, with_odometry, seed}, backend);
    errors.smoothed.push_back(grown.mahalanobis2(backend.view()));
    backend.optimize_full();
    errors.adjusted.push_back(grown.mahalanobis2(backend.view()));
  }
  return errors;
}

double quantile99(std::vector<double> values) {
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(values.size()));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

double largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

void check_weak_ground(int runs) {
  Errors all;
  for (int shared = 0; shared <= kMaxShared; ++shared) {
    const Errors errors = errors_of(shared, runs, true);
    INFO(shared << " shared landmarks");
    CHECK(largest(errors.smoothed) < kOneInAMillion);
    CHECK(largest(errors.adjusted) < kOneInAMillion);
    all.smoothed.insert(all.smoothed.end(), errors.smoothed.begin(), errors.smoothed.end());
    all.adjusted.insert(all.adjusted.end(), errors.adjusted.begin(), errors.adjusted.end());
  }
  CHECK(quantile99(all.smoothed) < 1.1 * kQuantile99);
  CHECK(quantile99(all.adjusted) < 1.1 * kQuantile99);
}

TEST_CASE("A keyframe that shares few landmarks is where odometry has it, or better") {
  check_weak_ground(20);
}

TEST_CASE("A keyframe that shares few landmarks is where odometry has it: a thousand of each",
          "[slow]") {
  check_weak_ground(1000);
}

TEST_CASE("The weak place is one: without odometry few landmarks lead anywhere") {
  CHECK(largest(errors_of(3, 30, false).smoothed) > 10 * kOneInAMillion);
}

}  // namespace
}  // namespace hybrid_slam
