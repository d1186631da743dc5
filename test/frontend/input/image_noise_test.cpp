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
  for (const double noise : {2.0, 8.0}) CHECK_FALSE(is_noisy(noisy_waves(noise)));
  const GrayImage truth = noisy_waves(0);
  for (const double noise : {15.0, 25.0}) {
    GrayImage image = noisy_waves(noise);
    CHECK(is_noisy(image));
    const sift::ImageNoise left = suppress_noise(image);
    CHECK(left.deviation == Approx(noise).epsilon(0.06));
    CHECK(left.smoothing == Approx(left.deviation / (4 * 3.545)).epsilon(0.01));
    CHECK(root_mean_square(image, truth) == Approx(4).margin(0.7));
  }
}

// Light that grows from left to right, counted by photons: `gain` grey levels each.
GrayImage counted_ramp(double brightest, double gain) {
  GrayImage image{320, 240, {}};
  std::mt19937 random(2);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      std::poisson_distribution<int> photons(brightest / gain * (x + 1) / image.width);
      image.pixels.push_back(static_cast<std::uint8_t>(std::min(255.0, gain * photons(random))));
    }
  }
  return image;
}

// Of what is left of straight lines along the columns first .. first + 39.
double column_noise(const GrayImage& image, int first) {
  double squares = 0;
  int count = 0;
  for (int x = first; x < first + 40; ++x) {
    double mean = 0;
    for (int y = 0; y < image.height; ++y) mean += image.row(y)[x];
    mean /= image.height;
    for (int y = 0; y < image.height; ++y, ++count) {
      squares += (image.row(y)[x] - mean) * (image.row(y)[x] - mean);
    }
  }
  return std::sqrt(squares / count);
}

TEST_CASE("Shot noise of little light becomes as strong everywhere, and what is there is kept") {
  for (const double gain : {1.0, 2.0}) {
    const GrayImage dark = counted_ramp(40, gain);
    CHECK_FALSE(is_noisy(dark));
    CHECK(is_noisy_in_the_dark(dark, 40));
    CHECK(column_noise(dark, 260) / column_noise(dark, 60) > 1.7);
    GrayImage image = dark;
    even_out_shot_noise(image, 40);
    // 2 sqrt(n + 3/8) of n photons has deviation 1: here 200 stands for its brightest.
    const double expected = 200 / (2 * std::sqrt(40 / gain));
    CHECK(column_noise(image, 60) == Approx(expected).epsilon(0.1));
    CHECK(column_noise(image, 260) == Approx(expected).epsilon(0.1));
    CHECK(suppress_noise(image).deviation == Approx(expected).epsilon(0.15));
  }
  // Light, or little noise for what light there is, or nothing at all.
  CHECK_FALSE(is_noisy_in_the_dark(counted_ramp(150, 1), 150));
  CHECK_FALSE(is_noisy_in_the_dark(counted_ramp(40, 0.02), 40));
  CHECK_FALSE(is_noisy_in_the_dark(counted_ramp(4, 1), 4));
}

TEST_CASE("Noise that was interpolated between pixels is smoothed as far as that which was not") {
  const GrayImage truth = enlarged(noisy_waves(0));
  for (const double noise : {25.0, 30.0}) {
    GrayImage image = enlarged(noisy_waves(noise));
    CHECK(coarse_noise(image) == Approx(noise).epsilon(0.15));
    REQUIRE(suppress_noise(image).deviation > 0);
    // Two pixels apart, too, a seventh of it is not seen.
    CHECK(root_mean_square(image, truth) == Approx(4).margin(1.5));
  }
}

}  // namespace hybrid_slam
