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

// What becomes grey of a colour image.
enum class GrayChannel { kGrey, kRed, kGreen, kBlue };  // kGrey: weighed as television does

struct ImageReading {
  GrayChannel channel = GrayChannel::kGrey;
  // The sample of an image of more than 8 bits that is white: cameras put 10 or 12 bits into 16.
  // 0: the least 2^n - 1 that no sample of the image exceeds.
  int white = 0;
};

// Decodes a PNG, JPEG, TIFF, PGM, PPM or BMP file, told by its content. Colour becomes grey, 16
// bits per sample become 8, an EXIF orientation is ignored (the calibration belongs to the stored
// pixels). Throws InputError naming the file if it is missing, truncated, damaged or of another
// kind. What goes unnoticed is a JPEG whose compressed data are altered to other valid ones: the
// format has no checksum.
GrayImage read_gray_image(const std::filesystem::path& path, const ImageReading& reading = {});

// The same for an image of which the size is known: another one is refused.
GrayImage read_gray_image(const std::filesystem::path& path, ImageSize expected,
                          const ImageReading& reading = {});

// The highest sample of an image of more than 8 bits; 0 of others. Throws as above.
int highest_wide_sample(const std::filesystem::path& path);

// The least 2^n - 1, from 255 on, that is not below the sample.
int white_above(int sample);

// Whether a file's name ends like that of an image of these kinds.
bool has_image_extension(const std::filesystem::path& path);

// Size of an image that can be read: it is decoded, and a damaged one refused as above.
ImageSize read_image_size(const std::filesystem::path& path);

}  // namespace hybrid_slam
