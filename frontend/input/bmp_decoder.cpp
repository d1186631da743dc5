#include <array>

#include "frontend/input/image_decoders.h"

// Windows bitmaps without compression: 8 bits with a palette, 24 and 32 bits.
namespace hybrid_slam {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kFileHeader = 14;
constexpr std::size_t kInfoHeader = 40;

std::uint32_t number_at(Bytes file, std::size_t at, int bytes) {
  std::uint32_t value = 0;
  for (int i = bytes - 1; i >= 0; --i) value = 256 * value + file[at + static_cast<std::size_t>(i)];
  return value;
}

// The grey of each value of a palette.
std::string read_palette(Bytes file, GrayChannel channel, std::array<std::uint8_t, 256>& grays) {
  const std::size_t begin = kFileHeader + number_at(file, 14, 4);
  std::uint32_t count = number_at(file, 46, 4);
  if (count == 0 || count > 256) count = 256;
  if (begin > file.size() || file.size() - begin < 4 * std::size_t{count}) return "truncated BMP";
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* const entry = &file[begin + 4 * i];  // blue, green, red, nothing
    grays[i] = gray_of(entry[2], entry[1], entry[0], channel);
  }
  return {};
}

}  // namespace

std::string decode_bmp(Bytes file, GrayChannel channel, const MakeRoom& make_room,
                       DecodedImage& image) {
  if (file.size() < kFileHeader + kInfoHeader) return "truncated BMP";
  const auto width = static_cast<std::int32_t>(number_at(file, 18, 4));
  const auto height = static_cast<std::int32_t>(number_at(file, 22, 4));
  const std::uint32_t bits = number_at(file, 28, 2);
  const std::uint32_t compression = number_at(file, 30, 4);
  if (number_at(file, 14, 4) < kInfoHeader) return "BMP with an old header, which is not read";
  if ((bits != 8 && bits != 24 && bits != 32) || (compression != 0 && compression != 3)) {
    return "BMP of " + std::to_string(bits) + " bits or compressed, which is not read";
  }
  const bool from_top = height < 0;
  const std::int64_t rows = from_top ? -std::int64_t{height} : std::int64_t{height};
  const std::uint64_t row_bytes =
      width > 0 ? std::uint64_t{bits} / 8 * static_cast<unsigned>(width) : 0;
  if (row_bytes > 0 && static_cast<std::uint64_t>(rows) > file.size() / row_bytes) {
    return "truncated BMP";
  }
  make_room(width < 0 ? 0 : static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(rows),
            image.gray);
  std::array<std::uint8_t, 256> palette{};
  if (bits == 8) {
    if (std::string wrong = read_palette(file, channel, palette); !wrong.empty()) return wrong;
  }
  const std::size_t begin = number_at(file, 10, 4);
  const std::size_t stride = (static_cast<std::size_t>(width) * bits + 31) / 32 * 4;
  if (begin > file.size() || file.size() - begin < stride * static_cast<std::size_t>(rows)) {
    return "truncated BMP";
  }
  for (int y = 0; y < image.gray.height; ++y) {
    const int stored = from_top ? y : image.gray.height - 1 - y;
    const std::uint8_t* const from = &file[begin + stride * static_cast<std::size_t>(stored)];
    std::uint8_t* const to = image.gray.row(y);
    for (int x = 0; x < width; ++x) {
      const std::uint8_t* const pixel = from + x * static_cast<int>(bits / 8);
      to[x] = bits == 8 ? palette[pixel[0]] : gray_of(pixel[2], pixel[1], pixel[0], channel);
    }
  }
  return {};
}

}  // namespace hybrid_slam
