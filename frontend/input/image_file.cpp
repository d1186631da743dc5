#include "frontend/input/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "frontend/input/image_decoders.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::uintmax_t kMaxFileSize = std::uintmax_t{1} << 30;
constexpr std::uint32_t kMaxSide = 1 << 16;
constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 30;
constexpr std::array<std::uint8_t, 8> kPngSignature{0x89, 'P', 'N', 'G', 0x0d, 0x0a, 0x1a, 0x0a};
constexpr std::array<std::uint8_t, 2> kJpegSignature{0xff, 0xd8};
constexpr std::array<std::uint8_t, 4> kTiffSignature{'I', 'I', 42, 0};
constexpr std::array<std::uint8_t, 4> kBigEndianTiffSignature{'M', 'M', 0, 42};
constexpr std::array<std::uint8_t, 2> kBmpSignature{'B', 'M'};

[[noreturn]] void fail(const std::string& name, const std::string& reason) {
  throw InputError(name + ": " + reason);
}

std::vector<std::uint8_t> read_bytes(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) fail(path, "no such image");
  if (fs::is_directory(path, error)) fail(path, "is a folder, not an image");
  const std::uintmax_t size = fs::is_regular_file(path, error) ? fs::file_size(path, error) : 0;
  if (error || size > kMaxFileSize) fail(path, "cannot be read");
  if (size == 0) fail(path, "empty image file");
  std::vector<std::uint8_t> bytes(size);
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!file) fail(path, "cannot be read");
  return bytes;
}

// A file that ends within the signature begins with it, too.
bool begins_with(Bytes bytes, Bytes signature) {
  const std::size_t compared = std::min(bytes.size(), signature.size());
  return std::ranges::equal(bytes.first(compared), signature.first(compared));
}

// Null if no decoder knows the file.
Decoder* decoder_of(Bytes bytes) {
  if (begins_with(bytes, kPngSignature)) return decode_png;
  if (begins_with(bytes, kJpegSignature)) return decode_jpeg;
  if (begins_with(bytes, kTiffSignature) || begins_with(bytes, kBigEndianTiffSignature)) {
    return decode_tiff;
  }
  if (begins_with(bytes, kBmpSignature)) return decode_bmp;
  const bool is_pnm =
      bytes.size() > 2 && bytes[0] == 'P' &&
      std::string_view("2356").find(static_cast<char>(bytes[1])) != std::string_view::npos;
  return is_pnm ? decode_pnm : nullptr;
}

// Grey of a colour with 16 bits per sample, as libpng weighs and rounds it.
std::uint32_t wide_gray_of(const std::uint16_t* rgb, GrayChannel channel) {
  switch (channel) {
    case GrayChannel::kRed:
      return rgb[0];
    case GrayChannel::kGreen:
      return rgb[1];
    case GrayChannel::kBlue:
      return rgb[2];
    case GrayChannel::kGrey:
      break;
  }
  return (9798U * rgb[0] + 19235U * rgb[1] + 3735U * rgb[2] + 16384U) >> 15;
}

}  // namespace

MakeRoom make_room_for(const std::optional<ImageSize>& expected, const std::string& name) {
  return [&](std::uint32_t width, std::uint32_t height, GrayImage& image) {
    if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide ||
        std::uint64_t{width} * height > kMaxPixels) {
      fail(name, "impossible image size in its header");
    }
    const ImageSize size{static_cast<int>(width), static_cast<int>(height)};
    if (expected && size != *expected) {
      fail(name, "image is " + std::to_string(size.width) + "x" + std::to_string(size.height) +
                     ", expected " + std::to_string(expected->width) + "x" +
                     std::to_string(expected->height));
    }
    image = {size.width, size.height,
             std::vector<std::uint8_t>(std::size_t{width} * std::size_t{height})};
  };
}

DecodedImage decode_image(Bytes file, const std::string& name, std::optional<ImageSize> expected,
                          GrayChannel channel) {
  if (file.empty()) fail(name, "empty image");
  DecodedImage image;
  Decoder* const decoder = decoder_of(file);
  const MakeRoom make_room = [&, make = make_room_for(expected, name)](
                                 std::uint32_t width, std::uint32_t height, GrayImage& gray) {
    if (!can_hold(file.size(), std::uint64_t{width} * height)) {
      fail(name, "truncated: its header tells of more pixels than its bytes can hold");
    }
    make(width, height, gray);
  };
  const std::string wrong = decoder == nullptr ? "neither PNG nor JPEG, TIFF, PGM, PPM or BMP"
                                               : decoder(file, channel, make_room, image);
  if (!wrong.empty()) fail(name, wrong);
  return image;
}

DecodedImage decode_image_file(const fs::path& path, std::optional<ImageSize> expected,
                               GrayChannel channel) {
  return decode_image(read_bytes(path), path.string(), expected, channel);
}

int highest_sample(const DecodedImage& image) {
  return image.is_wide() ? *std::max_element(image.samples.begin(), image.samples.end()) : 0;
}

GrayImage to_gray(DecodedImage&& image, const ImageReading& reading) {
  if (!image.is_wide()) return std::move(image.gray);
  const int white = reading.white > 0 ? reading.white : white_above(highest_sample(image));
  for (std::size_t i = 0; i < image.gray.pixels.size(); ++i) {
    const std::uint16_t* const s = &image.samples[i * static_cast<std::size_t>(image.channels)];
    const std::uint32_t sample = image.channels == 1 ? s[0] : wide_gray_of(s, reading.channel);
    image.gray.pixels[i] = static_cast<std::uint8_t>(
        std::min<std::uint32_t>(255, sample * 256 / (static_cast<std::uint32_t>(white) + 1)));
  }
  return std::move(image.gray);
}

GrayImage read_gray_image(const fs::path& path, const ImageReading& reading) {
  return to_gray(decode_image_file(path, std::nullopt, reading.channel), reading);
}

GrayImage read_gray_image(const fs::path& path, ImageSize expected, const ImageReading& reading) {
  return to_gray(decode_image_file(path, expected, reading.channel), reading);
}

int highest_wide_sample(const fs::path& path) {
  return highest_sample(decode_image_file(path, std::nullopt, GrayChannel::kGrey));
}

int white_above(int sample) {
  int white = 255;
  while (white < sample) white = 2 * white + 1;
  return white;
}

bool has_image_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<std::string_view, 9> kKnown{".png", ".jpg", ".jpeg", ".tif", ".tiff",
                                                   ".pgm", ".ppm", ".pnm",  ".bmp"};
  return std::find(kKnown.begin(), kKnown.end(), extension) != kKnown.end();
}

ImageSize read_image_size(const fs::path& path) {
  const GrayImage image = read_gray_image(path);
  return {image.width, image.height};
}

}  // namespace hybrid_slam
