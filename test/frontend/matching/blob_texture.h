#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>

#include "frontend/features/image.h"
#include "test/frontend/matching/random_descriptors.h"

namespace hybrid_slam {

// A random texture that is known at every place, not only at pixels: a sum of Gaussian blobs, with
// a standard deviation of about 26 grey levels.
class BlobTexture {
 public:
  // Covers x in [0, width], y in [0, height]; flat beyond.
  BlobTexture(double width, double height, std::mt19937_64& random) {
    const int count = static_cast<int>(width * height / 25);
    for (int i = 0; i < count; ++i) {
      const double sigma = 1.3 + 2.5 * random_unit(random);
      const double height_of_blob = (random_unit(random) < 0.5 ? -45 : 45) / std::sqrt(sigma);
      blobs_.push_back(
          {width * random_unit(random), height * random_unit(random), sigma, height_of_blob});
    }
  }

  // Grey values at pixel p: gain * texture(texture_from_image * p + offset) + bias, with normal
  // noise.
  GrayImage render(int width, int height, const Eigen::Matrix2d& texture_from_image,
                   const Eigen::Vector2d& offset, double gain, double bias, double noise,
                   std::mt19937_64& random) const {
    std::vector<double> sums(static_cast<std::size_t>(width * height), 0.0);
    const Eigen::Matrix2d image_from_texture = texture_from_image.inverse();
    const double stretch = image_from_texture.norm();
    for (const Blob& blob : blobs_) {
      const Eigen::Vector2d centre =
          image_from_texture * (Eigen::Vector2d(blob.x, blob.y) - offset);
      const int reach = static_cast<int>(std::ceil(4.5 * blob.sigma * stretch));
      const int cx = static_cast<int>(std::lround(centre.x()));
      const int cy = static_cast<int>(std::lround(centre.y()));
      for (int y = std::max(0, cy - reach); y <= std::min(height - 1, cy + reach); ++y) {
        for (int x = std::max(0, cx - reach); x <= std::min(width - 1, cx + reach); ++x) {
          const Eigen::Vector2d from_centre = texture_from_image * (Eigen::Vector2d(x, y) - centre);
          sums[static_cast<std::size_t>(y * width + x)] +=
              blob.amplitude * std::exp(-from_centre.squaredNorm() / (2 * blob.sigma * blob.sigma));
        }
      }
    }
    GrayImage image{width, height, {}};
    for (const double sum : sums) {
      const double value = gain * (120 + sum) + bias + noise * normal(random);
      image.pixels.push_back(static_cast<std::uint8_t>(std::clamp(std::round(value), 0.0, 255.0)));
    }
    return image;
  }

 private:
  struct Blob {
    double x, y, sigma, amplitude;
  };

  static double normal(std::mt19937_64& random) {
    const double radius = std::sqrt(-2 * std::log(1 - random_unit(random)));
    return radius * std::cos(6.283185307179586 * random_unit(random));
  }

  std::vector<Blob> blobs_;
};

}  // namespace hybrid_slam
