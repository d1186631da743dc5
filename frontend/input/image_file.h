#pragma once

#include <filesystem>

#include "cameras/files/input_error.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

struct ImageSize {
  int width = 0;   // [px]
  int height = 0;  // [px]
  bool operator==(const ImageSize&) const = default;
};

// Decodes a PNG or JPEG file, told by its content. Colour becomes grey, 16 bits per sample become
// 8, an EXIF orientation is ignored (the calibration belongs to the stored pixels). Throws
// InputError naming the file if it is missing, truncated, damaged or neither. What goes unnoticed
// is a JPEG whose compressed data are altered to other valid ones: the format has no checksum.
GrayImage read_gray_image(const std::filesystem::path& path);

// The same for an image of which the size is known: another one is refused.
GrayImage read_gray_image(const std::filesystem::path& path, ImageSize expected);

// Size of an image that can be read: it is decoded, and a damaged one refused as above.
ImageSize read_image_size(const std::filesystem::path& path);

}  // namespace hybrid_slam
