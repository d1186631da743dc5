#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "frontend/features/image.h"

namespace hybrid_slam {

// Makes room for an image, once its header is read: `image` gets this size and so many pixels.
// Throws if no image of such a size is wanted; nothing is decoded then.
using MakeRoom = std::function<void(std::uint32_t width, std::uint32_t height, GrayImage& image)>;

// Decode a whole file into `image` as read_gray_image() says. Return what is wrong, in one line, or
// nothing.
std::string decode_png(std::span<const std::uint8_t> file, const MakeRoom& make_room,
                       GrayImage& image);
std::string decode_jpeg(std::span<const std::uint8_t> file, const MakeRoom& make_room,
                        GrayImage& image);

}  // namespace hybrid_slam
