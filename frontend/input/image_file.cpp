#include "frontend/input/image_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <optional>
#include <span>
#include <string>
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

[[noreturn]] void fail(const fs::path& path, const std::string& reason) {
  throw InputError(path.string() + ": " + reason);
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

GrayImage read(const fs::path& path, std::optional<ImageSize> expected) {
  const std::vector<std::uint8_t> bytes = read_bytes(path);
  const auto make_room = [&](std::uint32_t width, std::uint32_t height, GrayImage& image) {
    if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide ||
        std::uint64_t{width} * height > kMaxPixels) {
      fail(path, "impossible image size in its header");
    }
    const ImageSize size{static_cast<int>(width), static_cast<int>(height)};
    if (expected && size != *expected) {
      fail(path, "image is " + std::to_string(size.width) + "x" + std::to_string(size.height) +
                     ", expected " + std::to_string(expected->width) + "x" +
                     std::to_string(expected->height));
    }
    image = {size.width, size.height,
             std::vector<std::uint8_t>(std::size_t{width} * std::size_t{height})};
  };
  GrayImage image;
  std::string wrong = "neither PNG nor JPEG";
  if (begins_with(bytes, kPngSignature)) {
    wrong = decode_png(bytes, make_room, image);
  } else if (begins_with(bytes, kJpegSignature)) {
    wrong = decode_jpeg(bytes, make_room, image);
  }
  if (!wrong.empty()) fail(path, wrong);
  return image;
}

}  // namespace

GrayImage read_gray_image(const fs::path& path) { return read(path, std::nullopt); }

GrayImage read_gray_image(const fs::path& path, ImageSize expected) { return read(path, expected); }

ImageSize read_image_size(const fs::path& path) {
  const GrayImage image = read_gray_image(path);
  return {image.width, image.height};
}

}  // namespace hybrid_slam
