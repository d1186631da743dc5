#include "test/frontend/features/test_images.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace hybrid_slam {
namespace {

// Mean of exp(-t^2 / (2 sigma^2)) over a pixel at distance t from the middle.
double mean_over_pixel(double t, double sigma) {
  const double unit = std::numbers::sqrt2 * sigma;
  return sigma * std::sqrt(std::numbers::pi / 2) *
         (std::erf((t + 0.5) / unit) - std::erf((t - 0.5) / unit));
}

}  // namespace

GrayImage to_image(int width, int height, const std::function<double(double, double)>& value) {
  GrayImage image{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double v = std::clamp(std::round(value(x, y)), 0.0, 255.0);
      image.pixels.push_back(static_cast<std::uint8_t>(v));
    }
  }
  return image;
}

GrayImage blob_image(int width, int height, const std::vector<Blob>& blobs, double amplitude) {
  return to_image(width, height, [&](double x, double y) {
    double sum = 60;
    for (const Blob& b : blobs) {
      if (std::max(std::abs(x - b.x), std::abs(y - b.y)) > 8 * b.sigma) continue;
      sum += amplitude * mean_over_pixel(x - b.x, b.sigma) * mean_over_pixel(y - b.y, b.sigma);
    }
    return sum;
  });
}

GrayImage texture(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<double> sums(static_cast<std::size_t>(width * height), 128);
  for (int i = 0; i < width * height / 60; ++i) {
    const Blob b{width * unit(), height * unit(), 1 + 3 * unit()};
    const double amplitude = unit() < 0.5 ? -40 : 40;
    const int reach = static_cast<int>(4 * b.sigma);
    for (int y = std::max(0, static_cast<int>(b.y) - reach);
         y < std::min(height, static_cast<int>(b.y) + reach); ++y) {
      for (int x = std::max(0, static_cast<int>(b.x) - reach);
           x < std::min(width, static_cast<int>(b.x) + reach); ++x) {
        const double r2 = (x - b.x) * (x - b.x) + (y - b.y) * (y - b.y);
        sums[static_cast<std::size_t>(y * width + x)] +=
            amplitude * std::exp(-r2 / (2 * b.sigma * b.sigma));
      }
    }
  }
  return to_image(width, height, [&](double x, double y) {
    return sums[static_cast<std::size_t>(static_cast<int>(y) * width + static_cast<int>(x))];
  });
}

}  // namespace hybrid_slam
