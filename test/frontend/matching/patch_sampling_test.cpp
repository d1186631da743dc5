#include "frontend/matching/patch_sampling.h"

#include <random>
#include <vector>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

ImagePyramid::Level random_level(int width, int height, std::mt19937& random) {
  ImagePyramid::Level level{width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    level.pixels.push_back(static_cast<std::uint16_t>(random()));
  }
  return level;
}

struct Weights {
  float w[4];

  explicit Weights(float t, float sum = 1) {
    const float t2 = t * t;
    const float t3 = t2 * t;
    const float half = 0.5F * sum;
    w[0] = half * (-t3 + 2 * t2 - t);
    w[1] = half * (3 * t3 - 5 * t2 + 2);
    w[2] = half * (-3 * t3 + 4 * t2 + t);
    w[3] = half * (t3 - t2);
  }

  template <typename Values>
  float sum(const Values& of) const {
    return w[0] * of(0) + w[1] * of(1) + w[2] * of(2) + w[3] * of(3);
  }
};

// Catmull-Rom interpolation [grey levels], along rows or along columns first.
float interpolated(const ImagePyramid::Level& level, double x, double y, bool columns_first) {
  const int left = static_cast<int>(x);
  const int top = static_cast<int>(y);
  const Weights wx(static_cast<float>(x - left));
  const Weights wy(static_cast<float>(y - top), 1 / ImagePyramid::kUnits);
  const auto at = [&](int row, int column) -> float {
    return level.row(top - 1 + row)[left - 1 + column];
  };
  if (columns_first) {
    return wx.sum([&](int c) { return wy.sum([&](int row) { return at(row, c); }); });
  }
  return wy.sum([&](int row) { return wx.sum([&](int c) { return at(row, c); }); });
}

// A machine that fuses multiplications with additions must not do so.
TEST_CASE("Patches of any size, up to the level's border, are interpolated to the last bit") {
  std::mt19937 random(3);
  for (const int half : {1, 2, 3, 7, 8, 50}) {
    CAPTURE(half);
    const int side = 2 * half + 1;
    const ImagePyramid::Level level = random_level(side + 3, side + 3, random);
    std::vector<float> samples(static_cast<std::size_t>(side * side));
    const Eigen::Vector2d centre(half + 1.75, half + 1.25);
    const auto differing = [&](const Eigen::Matrix2d& warp, bool columns_first) {
      int count = 0;
      for (int i = 0; i < side * side; ++i) {
        const int u = i % side - half;
        const int v = i / side - half;
        const Eigen::Vector2d at = centre + warp.col(0) * u + warp.col(1) * v;
        const float expected = interpolated(level, at.x(), at.y(), columns_first);
        count += samples[static_cast<std::size_t>(i)] == expected ? 0 : 1;
      }
      return count;
    };
    sample_square(level, centre.x(), centre.y(), half, samples.data());
    CHECK(differing(Eigen::Matrix2d::Identity(), true) == 0);
    Eigen::Matrix2d warp;
    warp << 0.8, -0.15, 0.1, 0.7;
    sample_warped(level, centre, warp, half, samples.data());
    CHECK(differing(warp, false) == 0);
  }
}

TEST_CASE("Sums of products are made row by row, to the last bit") {
  std::mt19937 random(4);
  std::normal_distribution<float> number(0, 30);
  for (const Eigen::Index rows : {9, 49, 225, 289}) {
    Eigen::Matrix<float, Eigen::Dynamic, kSummedColumns> columns(rows, kSummedColumns);
    for (Eigen::Index i = 0; i < columns.size(); ++i) columns.data()[i] = number(random);
    const Eigen::Matrix<double, Eigen::Dynamic, kSummedColumns> exact = columns.cast<double>();
    SummedProducts expected = SummedProducts::Zero();
    for (Eigen::Index i = 0; i < rows; ++i) expected += exact.row(i).transpose() * exact.row(i);
    CHECK(sums_of_products(columns.data(), static_cast<std::size_t>(rows)) == expected);
  }
}

}  // namespace
}  // namespace hybrid_slam
