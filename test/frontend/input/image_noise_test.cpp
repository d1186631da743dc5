#include "frontend/input/image_noise.h"

#include <algorithm>
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
    double squares = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const double off = static_cast<double>(image.pixels[i]) - truth.pixels[i];
      squares += off * off;
    }
    CHECK(std::sqrt(squares / static_cast<double>(image.pixels.size())) == Approx(4).margin(0.7));
  }
}

}  // namespace hybrid_slam
