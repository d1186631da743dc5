#include "frontend/input/image_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::uintmax_t kMaxFileSize = std::uintmax_t{1} << 30;
constexpr int kMaxSide = 1 << 16;
constexpr std::array<std::uint8_t, 8> kPngSignature{0x89, 'P', 'N', 'G', 0x0d, 0x0a, 0x1a, 0x0a};

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

std::uint32_t big_endian(Bytes bytes, std::size_t at, int count) {
  std::uint32_t value = 0;
  for (int i = 0; i < count; ++i) value = value << 8 | bytes[at + static_cast<std::size_t>(i)];
  return value;
}

constexpr std::array<std::uint32_t, 256> kCrcTable = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t n = 0; n < 256; ++n) {
    std::uint32_t c = n;
    for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xedb88320U ^ (c >> 1) : c >> 1;
    table[n] = c;
  }
  return table;
}();

std::uint32_t crc32(Bytes bytes) {
  std::uint32_t c = 0xffffffffU;
  for (const std::uint8_t byte : bytes) c = kCrcTable[(c ^ byte) & 0xff] ^ (c >> 8);
  return ~c;
}

ImageSize checked_size(const fs::path& path, std::uint32_t width, std::uint32_t height) {
  if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide) {
    fail(path, "impossible image size in its header");
  }
  return {static_cast<int>(width), static_cast<int>(height)};
}

// Walks the chunks (length, type, data, CRC) up to IEND.
ImageSize check_png(const fs::path& path, Bytes bytes) {
  ImageSize size;
  std::size_t at = kPngSignature.size();
  while (true) {
    if (bytes.size() - at < 12) fail(path, "truncated PNG");
    const std::size_t length = big_endian(bytes, at, 4);
    if (bytes.size() - at - 12 < length) fail(path, "truncated PNG");
    if (crc32(bytes.subspan(at + 4, length + 4)) != big_endian(bytes, at + 8 + length, 4)) {
      fail(path, "damaged PNG (wrong checksum)");
    }
    const std::string type(bytes.begin() + static_cast<std::ptrdiff_t>(at) + 4,
                           bytes.begin() + static_cast<std::ptrdiff_t>(at) + 8);
    if (size.width == 0) {
      if (type != "IHDR" || length != 13) fail(path, "damaged PNG (no header)");
      size = checked_size(path, big_endian(bytes, at + 8, 4), big_endian(bytes, at + 12, 4));
    }
    if (type == "IEND") return size;
    at += length + 12;
  }
}

bool is_frame_header(std::uint8_t marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

// First position at or after `at` of a marker that ends the entropy-coded data of a scan.
std::size_t end_of_scan(Bytes bytes, std::size_t at) {
  for (; at + 1 < bytes.size(); ++at) {
    const std::uint8_t next = bytes[at + 1];
    const bool restart = next >= 0xd0 && next <= 0xd7;
    if (bytes[at] == 0xff && next != 0 && next != 0xff && !restart) return at;
  }
  return bytes.size();
}

// Walks the segments (marker, length, data) and the scans up to EOI.
ImageSize check_jpeg(const fs::path& path, Bytes bytes) {
  ImageSize size;
  bool has_scan = false;
  std::size_t at = 2;  // after SOI
  while (true) {
    while (at + 1 < bytes.size() && bytes[at] == 0xff && bytes[at + 1] == 0xff) ++at;
    if (bytes.size() - std::min(at, bytes.size()) < 2) fail(path, "truncated JPEG");
    if (bytes[at] != 0xff) fail(path, "damaged JPEG");
    const std::uint8_t marker = bytes[at + 1];
    at += 2;
    if (marker == 0xd9) {
      if (!has_scan) fail(path, "damaged JPEG (no image data)");
      return size;
    }
    if (bytes.size() - at < 2) fail(path, "truncated JPEG");
    const std::size_t length = big_endian(bytes, at, 2);
    if (length < 2) fail(path, "damaged JPEG");
    if (bytes.size() - at < length) fail(path, "truncated JPEG");
    if (is_frame_header(marker)) {
      if (length < 8) fail(path, "damaged JPEG");
      size = checked_size(path, big_endian(bytes, at + 5, 2), big_endian(bytes, at + 3, 2));
    }
    at += length;
    if (marker == 0xda) {
      if (size.width == 0) fail(path, "damaged JPEG (no frame header)");
      has_scan = true;
      at = end_of_scan(bytes, at);
    }
  }
}

ImageSize check_structure(const fs::path& path, Bytes bytes) {
  if (bytes.size() >= 2 && bytes[0] == 0xff && bytes[1] == 0xd8) return check_jpeg(path, bytes);
  const std::size_t compared = std::min(bytes.size(), kPngSignature.size());
  if (std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(compared),
                 kPngSignature.begin())) {
    if (compared < kPngSignature.size()) fail(path, "truncated PNG");
    return check_png(path, bytes);
  }
  fail(path, "neither PNG nor JPEG");
}

cv::Mat decode(const std::vector<std::uint8_t>& bytes) {
  try {
    return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    return {};
  }
}

}  // namespace

ImageSize read_image_size(const fs::path& path) { return check_structure(path, read_bytes(path)); }

GrayImage read_gray_image(const fs::path& path, ImageSize expected) {
  const std::vector<std::uint8_t> bytes = read_bytes(path);
  const ImageSize size = check_structure(path, bytes);
  if (size != expected) {
    fail(path, "image is " + std::to_string(size.width) + "x" + std::to_string(size.height) +
                   ", expected " + std::to_string(expected.width) + "x" +
                   std::to_string(expected.height));
  }
  const cv::Mat decoded = decode(bytes);
  if (decoded.empty() || decoded.type() != CV_8UC1 || decoded.cols != size.width ||
      decoded.rows != size.height) {
    fail(path, "image cannot be decoded");
  }
  GrayImage image{size.width, size.height, {}};
  image.pixels.resize(decoded.total());
  for (int y = 0; y < size.height; ++y) {
    std::copy_n(decoded.ptr<std::uint8_t>(y), size.width, image.row(y));
  }
  return image;
}

}  // namespace hybrid_slam
