#pragma once

#include <string>

#include "frontend/features/image.h"

namespace hybrid_slam {

// The bytes of a JPEG file. `quality` 1..100. Throws std::logic_error for an empty image.
std::string encode_jpeg(const GrayImage& image, int quality);

}  // namespace hybrid_slam
