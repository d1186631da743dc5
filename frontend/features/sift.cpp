#include "frontend/features/sift.h"

#include <cmath>
#include <stdexcept>

namespace hybrid_slam {
namespace {

// Where the uncertainty of a position begins to grow with the scale [px]; see SiftOptions.
constexpr float kScaleOfGrowth = 4.0F;

}  // namespace

float SiftOptions::position_sigma(float scale) const {
  return static_cast<float>(keypoint_sigma) * std::hypot(1.0F, scale / kScaleOfGrowth);
}

std::string SiftOptions::validate() const {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0; };
  if (max_features < 1) return "max_features must be positive";
  if (octave_layers < 1 || octave_layers > 10) return "octave_layers must lie in 1..10";
  if (!std::isfinite(contrast_threshold) || contrast_threshold < 0) {
    return "contrast_threshold must not be negative";
  }
  if (!positive(edge_threshold)) return "edge_threshold must be positive";
  if (!positive(initial_sigma)) return "initial_sigma must be positive";
  if (!positive(keypoint_sigma)) return "keypoint_sigma must be positive";
  return {};
}

const SiftOptions& checked(const SiftOptions& options) {
  if (const std::string error = options.validate(); !error.empty()) {
    throw std::invalid_argument("SIFT options: " + error);
  }
  return options;
}

void check_sizes(const GrayImage& image, const GrayImage* mask) {
  const auto size = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (image.pixels.size() != size) throw std::logic_error("image: size and pixels disagree");
  if (mask &&
      (mask->width != image.width || mask->height != image.height || mask->pixels.size() != size)) {
    throw std::logic_error("mask: not the size of the image");
  }
}

}  // namespace hybrid_slam
