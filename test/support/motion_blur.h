#pragma once

#include <algorithm>

#include "frontend/features/image.h"

namespace hybrid_slam {

// Each pixel the mean of `length` (odd) pixels of its row, as a camera sees that moves sideways
// while it exposes.
inline GrayImage blurred_along_rows(const GrayImage& image, int length) {
  GrayImage result = image;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int sum = 0;
      for (int k = -(length / 2); k <= length / 2; ++k) {
        sum += image.row(y)[std::clamp(x + k, 0, image.width - 1)];
      }
      result.row(y)[x] = static_cast<std::uint8_t>(sum / length);
    }
  }
  return result;
}

}  // namespace hybrid_slam
