#include "frontend/input/image_noise.h"

#include <algorithm>
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

// The kernel's response, its nine pixels so far apart.
int response(const std::array<const std::uint8_t*, 3>& rows, int x, int spacing) {
  const auto bend = [=](const std::uint8_t* row) {
    return row[x - spacing] - 2 * row[x] + row[x + spacing];
  };
  return bend(rows[0]) - 2 * bend(rows[1]) + bend(rows[2]);
}

double noise_at(const GrayImage& image, int spacing) {
  std::array<int, 16 * 255 + 1> histogram{};
  int total = 0;
  for (int y = spacing; y < image.height - spacing; y += kRowStep) {
    const std::array rows{image.row(y - spacing), image.row(y), image.row(y + spacing)};
    for (int x = spacing; x < image.width - spacing; ++x, ++total) {
      ++histogram[static_cast<std::size_t>(std::abs(response(rows, x, spacing)))];
    }
  }
  int below = 0;
  for (std::size_t value = 0; value < histogram.size(); ++value) {
    below += histogram[value];
    if (2 * below >= total) return static_cast<double>(value) / kKernelGain / kMedianOfNormal;
  }
  return 0;
}

// Of white noise, 1 / (2 sqrt(pi) s) is left behind a Gaussian of standard deviation s.
double smoothing_of(double noise) { return noise / (2 * std::sqrt(std::numbers::pi) * kQuiet); }

}  // namespace

double image_noise(const GrayImage& image) { return noise_at(image, 1); }

double coarse_noise(const GrayImage& image) {
  return std::max(noise_at(image, 1), noise_at(image, 2));
}

bool is_noisy(const GrayImage& image) { return smoothing_of(image_noise(image)) >= kMinSmoothing; }

bool suppress_noise(GrayImage& image) {
  if (!is_noisy(image)) return false;
  const double smoothing = smoothing_of(coarse_noise(image));
  cv::Mat pixels(image.height, image.width, CV_8UC1, image.pixels.data());
  cv::GaussianBlur(pixels.clone(), pixels, cv::Size(), smoothing);
  return true;
}

}  // namespace hybrid_slam
