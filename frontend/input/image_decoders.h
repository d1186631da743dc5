#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "frontend/features/image.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {

// Makes room for an image, once its header is read: `image` gets this size and so many pixels.
// Throws if no image of such a size is wanted; nothing is decoded then.
using MakeRoom = std::function<void(std::uint32_t width, std::uint32_t height, GrayImage& image)>;

// What a file holds: a grey image or, of more than 8 bits, the samples it is to be made of, row by
// row, one (grey) or three (red, green, blue) per pixel.
struct DecodedImage {
  GrayImage gray;  // without values yet if there are samples
  int channels = 0;
  std::vector<std::uint16_t> samples;

  bool is_wide() const { return !samples.empty(); }
  void make_wide(int channel_count) {
    channels = channel_count;
    samples.resize(gray.pixels.size() * static_cast<std::size_t>(channel_count));
  }
};

// Grey of a colour: a channel or, as libpng weighs and rounds them, all three.
inline std::uint8_t gray_of(int red, int green, int blue, GrayChannel channel) {
  switch (channel) {
    case GrayChannel::kRed:
      return static_cast<std::uint8_t>(red);
    case GrayChannel::kGreen:
      return static_cast<std::uint8_t>(green);
    case GrayChannel::kBlue:
      return static_cast<std::uint8_t>(blue);
    case GrayChannel::kGrey:
      break;
  }
  return static_cast<std::uint8_t>((9798 * red + 19235 * green + 3735 * blue) >> 15);
}

// Whether a file of this size may hold so many bytes of pixels: the best compression in use, that
// of images of one colour, makes some 10,000 bytes of one. To be asked before there is room for
// them.
inline bool can_hold(std::size_t file_size, std::uint64_t bytes) {
  constexpr std::uint64_t kMostOfOne = 1 << 14;
  return bytes / kMostOfOne <= file_size;
}

// Decode a whole file into `image` as read_gray_image() says. Return what is wrong, in one line, or
// nothing.
using Decoder = std::string(std::span<const std::uint8_t> file, GrayChannel channel,
                            const MakeRoom& make_room, DecodedImage& image);
Decoder decode_png;
Decoder decode_jpeg;
Decoder decode_tiff;
Decoder decode_pnm;
Decoder decode_bmp;

// What every reader of images does with them; `name` begins its complaints.

// Refuses impossible sizes, and another one than expected. Both arguments must outlive it.
MakeRoom make_room_for(const std::optional<ImageSize>& expected, const std::string& name);

// A whole image file that is in memory, told by its content. Throws InputError as
// read_gray_image() does.
DecodedImage decode_image(std::span<const std::uint8_t> file, const std::string& name,
                          std::optional<ImageSize> expected, GrayChannel channel);
DecodedImage decode_image_file(const std::filesystem::path& path, std::optional<ImageSize> expected,
                               GrayChannel channel);

// The highest sample of an image of more than 8 bits; 0 of others.
int highest_sample(const DecodedImage& image);

// 8 bits of however many; the channel has been chosen for 8 bits, and is for more.
GrayImage to_gray(DecodedImage&& image, const ImageReading& reading);

}  // namespace hybrid_slam
