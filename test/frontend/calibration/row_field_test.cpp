#include "frontend/calibration/row_field.h"

#include <catch2/catch.hpp>
#include <random>

#include "frontend/calibration/rig_calibrator.h"

namespace hybrid_slam {
namespace {

template <typename Rows>
RowField field_of(const Rows& rows, int matches, int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> column(0, 511), row(0, 383);
  std::normal_distribution<double> noise(0, 0.3);
  RowField field(512, 384);
  for (int i = 0; i < matches; ++i) {
    const double x = column(random), y = row(random);
    field.add(x, y, rows(x, y) + noise(random));
  }
  return field;
}

TEST_CASE("what is systematic in the rows is told without their noise", "[row_field]") {
  const RowField off = field_of([](double, double y) { return y > 192 ? 0.4 : -0.4; }, 4000, 1);
  CHECK(off.systematic_rms() == Approx(0.4).epsilon(0.05));
  CHECK(off.at(0).mean() == Approx(-0.4).margin(0.15));
  CHECK(off.at(47).mean() == Approx(0.4).margin(0.15));
  CHECK(field_of([](double, double) { return 0.0; }, 4000, 1).systematic_rms() < 0.02);
  CHECK(RowField(512, 384).systematic_rms() == 0);
}

TEST_CASE("a pair's error of the rows is the median of its matches of small keypoints",
          "[row_field]") {
  StereoFeatures features;
  CHECK_FALSE(row_error(features));
  const auto add = [&](float rows, float scale, bool matched) {
    const auto place = static_cast<float>(features.left.keypoints.size());
    features.right_of_left.push_back(matched ? static_cast<int>(place) : -1);
    features.left.keypoints.push_back({10 * place, 100, scale, 0, 1, 1});
    features.right.keypoints.push_back({10 * place, 100 - rows, scale, 0, 1, 1});
  };
  add(0.25F, 2, true);
  add(-0.5F, 2, true);
  add(0.75F, 3, true);
  add(40, 2, false);
  add(0.9F, 8, true);  // large
  CHECK(row_error(features).value() == 0.5);
}

}  // namespace
}  // namespace hybrid_slam
