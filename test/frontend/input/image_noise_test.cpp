#include "frontend/input/image_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// Waves of 40 px and normal noise.
GrayImage noisy_waves(double noise) {
  GrayImage image{320, 240, {}};
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double value = 128 + 40 * std::sin(0.157 * x) * std::cos(0.157 * y);
      image.pixels.push_back(static_cast<std::uint8_t>(
          std::lround(std::clamp(value + noise * normal(random), 0.0, 255.0))));
    }
  }
  return image;
}

// Weights of Catmull-Rom interpolation at -1, 0, 1, 2 for t in [0, 1).
std::array<double, 4> cubic_weights(double t) {
  return {0.5 * t * (2 * t - t * t - 1), 0.5 * (3 * t * t * t - 5 * t * t + 2),
          0.5 * t * (4 * t - 3 * t * t + 1), 0.5 * t * t * (t - 1)};
}

// The image enlarged by 5 %: as in rectification, pixels lie anywhere between those that there
// were.
GrayImage enlarged(const GrayImage& image) {
  GrayImage result{image.width, image.height, {}};
  for (int y = 0; y < result.height; ++y) {
    const double v = 2 + y / 1.05;
    const std::array<double, 4> rows = cubic_weights(v - std::floor(v));
    for (int x = 0; x < result.width; ++x) {
      const double u = 2 + x / 1.05;
      const std::array<double, 4> columns = cubic_weights(u - std::floor(u));
      double value = 0;
      for (int i = 0; i < 16; ++i) {
        value += rows[static_cast<std::size_t>(i / 4)] * columns[static_cast<std::size_t>(i % 4)] *
                 image.row(static_cast<int>(v) - 1 + i / 4)[static_cast<int>(u) - 1 + i % 4];
      }
      result.pixels.push_back(
          static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0))));
    }
  }
  return result;
}

double root_mean_square(const GrayImage& image, const GrayImage& truth) {
  double squares = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const double off = static_cast<double>(image.pixels[i]) - truth.pixels[i];
    squares += off * off;
  }
  return std::sqrt(squares / static_cast<double>(image.pixels.size()));
}

}  // namespace

TEST_CASE("Noise is measured in the presence of structure") {
  for (const double noise : {3.0, 10.0, 25.0}) {
    CHECK(image_noise(noisy_waves(noise)) == Approx(noise).epsilon(0.06));
  }
  CHECK(image_noise(noisy_waves(0)) < 1);
  CHECK(image_noise(GrayImage{2, 2, {1, 2, 3, 4}}) == 0);
}

TEST_CASE("Much noise is smoothed down, little is left as it is") {
  for (const double noise : {2.0, 8.0}) {
    const GrayImage before = noisy_waves(noise);
    GrayImage image = before;
    CHECK_FALSE(suppress_noise(image));
    CHECK(image.pixels == before.pixels);
  }
  const GrayImage truth = noisy_waves(0);
  for (const double noise : {15.0, 25.0}) {
    GrayImage image = noisy_waves(noise);
    REQUIRE(suppress_noise(image));
    CHECK(root_mean_square(image, truth) == Approx(4).margin(0.7));
  }
}

TEST_CASE("Noise that was interpolated between pixels is smoothed as far as that which was not") {
  const GrayImage truth = enlarged(noisy_waves(0));
  for (const double noise : {25.0, 30.0}) {
    GrayImage image = enlarged(noisy_waves(noise));
    CHECK(coarse_noise(image) == Approx(noise).epsilon(0.15));
    REQUIRE(suppress_noise(image));
    // Two pixels apart, too, a seventh of it is not seen.
    CHECK(root_mean_square(image, truth) == Approx(4).margin(1.5));
  }
}

}  // namespace hybrid_slam
