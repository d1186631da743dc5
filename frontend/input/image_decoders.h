#pragma once

#include <cstdint>
#include <functional>
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

// Decode a whole file into `image` as read_gray_image() says. Return what is wrong, in one line, or
// nothing.
using Decoder = std::string(std::span<const std::uint8_t> file, GrayChannel channel,
                            const MakeRoom& make_room, DecodedImage& image);
Decoder decode_png;
Decoder decode_jpeg;
Decoder decode_tiff;
Decoder decode_pnm;
Decoder decode_bmp;

}  // namespace hybrid_slam
