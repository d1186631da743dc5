#include "frontend/features/image_quality.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

namespace hybrid_slam {
namespace {

GrayImage noise_image(int width, int height, int low, int high) {
  std::mt19937 random(3);
  GrayImage image{width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    image.pixels.push_back(static_cast<std::uint8_t>(
        low + static_cast<int>(random() % static_cast<unsigned>(high - low))));
  }
  return image;
}

// Squares of 24 pixels of random grey levels: edges, as what real images show has.
GrayImage squares(int width, int height) {
  const GrayImage levels = noise_image(width / 24 + 1, height / 24 + 1, 0, 256);
  GrayImage image{width, height,
                  std::vector<std::uint8_t>(static_cast<std::size_t>(width * height))};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.row(y)[x] = levels.row(y / 24)[x / 24];
  }
  return image;
}

// Mean over `width` pixels along rows or columns.
GrayImage blurred(const GrayImage& image, int width, bool columns) {
  GrayImage out = image;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int sum = 0;
      for (int k = -width / 2; k <= width / 2; ++k) {
        sum += columns ? image.row(std::clamp(y + k, 0, image.height - 1))[x]
                       : image.row(y)[std::clamp(x + k, 0, image.width - 1)];
      }
      out.row(y)[x] = static_cast<std::uint8_t>(sum / (2 * (width / 2) + 1));
    }
  }
  return out;
}

TEST_CASE("Brightness and saturation are those of the histogram") {
  const ImageQuality dark = image_quality(noise_image(320, 240, 0, 40));
  CHECK(dark.brightest == Approx(39).margin(1));
  CHECK(dark.saturated == 0);
  const ImageQuality bright = image_quality(noise_image(320, 240, 200, 256));
  CHECK(bright.saturated == Approx(6.0 / 56).margin(0.01));
  CHECK(image_quality(GrayImage()).brightest == 0);
}

TEST_CASE("Blur grows with its width, along rows as along columns") {
  const GrayImage sharp = squares(320, 240);
  CHECK(image_quality(sharp).blur < 0.2);
  for (const bool columns : {false, true}) {
    double before = image_quality(sharp).blur;
    for (const int width : {3, 7, 15}) {
      const double blur = image_quality(blurred(sharp, width, columns)).blur;
      CHECK(blur > before);
      before = blur;
    }
    CHECK(before > 0.5);
  }
  CHECK(image_quality(GrayImage{64, 64, std::vector<std::uint8_t>(64 * 64, 90)}).blur == 1);
}

TEST_CASE("The signature tells images apart") {
  const GrayImage image = noise_image(64, 48, 0, 256);
  GrayImage other = image;
  CHECK(image_quality(image).signature == image_quality(other).signature);
  other.row(8)[5] ^= 1;
  CHECK(image_quality(image).signature != image_quality(other).signature);
}

TEST_CASE("The share that a mask covers") {
  GrayImage mask{10, 10, std::vector<std::uint8_t>(100, 255)};
  std::fill_n(mask.pixels.begin(), 30, 0);
  CHECK(masked_share(mask) == Approx(0.3));
  CHECK(masked_share(GrayImage()) == 0);
}

}  // namespace
}  // namespace hybrid_slam
