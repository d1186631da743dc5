#include "cameras/calibration/calibration_section.h"

#include <cmath>

namespace hybrid_slam {

namespace {
constexpr int kMaxImageSize = 1 << 16;  // [px]
}  // namespace

int image_size(const YamlSection& section, const std::string& key, double value) {
  if (!(value >= 1 && value <= kMaxImageSize) || value != std::floor(value)) {
    section.fail(key, "is no image size");
  }
  return static_cast<int>(value);
}

void check_intrinsics(const YamlSection& section, const double* k, int width, int height,
                      const std::string& key) {
  if (!(k[0] > 0) || !(k[1] > 0)) section.fail(key, "the focal length must be positive");
  if (width > 0 && (k[2] < 0 || k[2] > width || k[3] < 0 || k[3] > height)) {
    section.fail(key, "the principal point lies outside the image");
  }
}

}  // namespace hybrid_slam
