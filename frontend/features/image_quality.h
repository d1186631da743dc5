#pragma once

#include <cstdint>

#include "frontend/features/image.h"

namespace hybrid_slam {

// What an image is fit for, by its grey levels alone. Of a sample of its pixels: a fraction of a
// millisecond.
struct ImageQuality {
  double brightest = 0;  // grey level that 99 % of the pixels do not exceed, 0..255
  double saturated = 0;  // share of pixels of grey level 250 or more
  // 0 (sharp) .. 1: the share of the differences between neighbouring pixels that remains where the
  // image is blurred over 9 pixels; the larger one of rows and columns. It hardly depends on what
  // the image shows (Crete et al., The Blur Effect, 2007).
  double blur = 0;
  std::uint64_t signature = 0;  // the same for the same pixels
};

ImageQuality image_quality(const GrayImage& image);

// Share of the pixels that are zero.
double masked_share(const GrayImage& mask);

}  // namespace hybrid_slam
