#include "frontend/input/image_noise.h"

#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include <opencv2/imgproc.hpp>

namespace hybrid_slam {
namespace {

constexpr int kRowStep = 4;            // every fourth row tells as much
constexpr double kQuiet = 4;           // [grey levels]
constexpr double kMinSmoothing = 0.7;  // [px]

// Of absolute values of a normal distribution: median over standard deviation.
constexpr double kMedianOfNormal = 0.6745;

// The kernel [1 -2 1; -2 4 -2; 1 -2 1] turns white noise into six times as much.
constexpr double kKernelGain = 6;

int response(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
             int x) {
  const auto bend = [x](const std::uint8_t* row) { return row[x - 1] - 2 * row[x] + row[x + 1]; };
  return bend(above) - 2 * bend(here) + bend(below);
}

// Of white noise, 1 / (2 sqrt(pi) s) is left behind a Gaussian of standard deviation s.
double smoothing_of(const GrayImage& image) {
  return image_noise(image) / (2 * std::sqrt(std::numbers::pi) * kQuiet);
}

}  // namespace

double image_noise(const GrayImage& image) {
  std::array<int, 16 * 255 + 1> histogram{};
  int total = 0;
  for (int y = 1; y < image.height - 1; y += kRowStep) {
    for (int x = 1; x < image.width - 1; ++x, ++total) {
      const int value = response(image.row(y - 1), image.row(y), image.row(y + 1), x);
      ++histogram[static_cast<std::size_t>(std::abs(value))];
    }
  }
  int below = 0;
  for (std::size_t value = 0; value < histogram.size(); ++value) {
    below += histogram[value];
    if (2 * below >= total) return static_cast<double>(value) / kKernelGain / kMedianOfNormal;
  }
  return 0;
}

bool is_noisy(const GrayImage& image) { return smoothing_of(image) >= kMinSmoothing; }

bool suppress_noise(GrayImage& image) {
  const double smoothing = smoothing_of(image);
  if (smoothing < kMinSmoothing) return false;
  cv::Mat pixels(image.height, image.width, CV_8UC1, image.pixels.data());
  cv::GaussianBlur(pixels.clone(), pixels, cv::Size(), smoothing);
  return true;
}

}  // namespace hybrid_slam
