#pragma once

#include <filesystem>

#include "cameras/input_error.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

struct ImageSize {
  int width = 0;   // [px]
  int height = 0;  // [px]
  bool operator==(const ImageSize&) const = default;
};

// Size of a PNG or JPEG file from its header; nothing is decoded. Throws InputError if the file is
// missing, is neither, or ends before its end marker.
ImageSize read_image_size(const std::filesystem::path& path);

// Decodes a PNG or JPEG file, told by its content. Colour becomes grey, 16 bits per sample are
// scaled to 8, an EXIF orientation is ignored (the calibration belongs to the stored pixels).
// Throws InputError naming the file if it is missing, truncated, damaged or not of the `expected`
// size. Decoders return what they have of a truncated file; so its structure is walked first, up to
// the end marker (PNG IEND, with the checksums on the way; JPEG EOI). What goes unnoticed is a JPEG
// whose compressed data are altered in the middle: the format has no checksum.
GrayImage read_gray_image(const std::filesystem::path& path, ImageSize expected);

}  // namespace hybrid_slam
