#include "frontend/input/bags/raw_image.h"

#include <bit>
#include <cstring>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "cameras/files/printable.h"

namespace hybrid_slam {

namespace {

// How the samples of a pixel lie.
struct Encoding {
  std::string_view name;
  int bytes = 1;          // per sample
  int samples = 1;        // per pixel
  int red = 0, blue = 0;  // places among the samples; green is the second
  int bayer = -1;         // OpenCV's code that makes it blue, green, red
};

// ROS names a Bayer pattern by its first two rows, OpenCV by its second row, from the second pixel.
constexpr Encoding kEncodings[] = {
    {"mono8"},
    {"8UC1"},
    {"mono16", 2},
    {"16UC1", 2},
    {"rgb8", 1, 3, 0, 2},
    {"bgr8", 1, 3, 2, 0},
    {"8UC3", 1, 3, 2, 0},
    {"rgba8", 1, 4, 0, 2},
    {"bgra8", 1, 4, 2, 0},
    {"8UC4", 1, 4, 2, 0},
    {"rgb16", 2, 3, 0, 2},
    {"bgr16", 2, 3, 2, 0},
    {"rgba16", 2, 4, 0, 2},
    {"bgra16", 2, 4, 2, 0},
    {"bayer_rggb8", 1, 1, 0, 0, cv::COLOR_BayerBG2BGR},
    {"bayer_bggr8", 1, 1, 0, 0, cv::COLOR_BayerRG2BGR},
    {"bayer_gbrg8", 1, 1, 0, 0, cv::COLOR_BayerGR2BGR},
    {"bayer_grbg8", 1, 1, 0, 0, cv::COLOR_BayerGB2BGR},
    {"bayer_rggb16", 2, 1, 0, 0, cv::COLOR_BayerBG2BGR},
    {"bayer_bggr16", 2, 1, 0, 0, cv::COLOR_BayerRG2BGR},
    {"bayer_gbrg16", 2, 1, 0, 0, cv::COLOR_BayerGR2BGR},
    {"bayer_grbg16", 2, 1, 0, 0, cv::COLOR_BayerGB2BGR},
};

const Encoding& find_encoding(std::string_view wanted, const std::string& name) {
  for (const Encoding& encoding : kEncodings) {
    if (encoding.name == wanted) return encoding;
  }
  throw InputError(name + ": image encoding \"" + printable(wanted.substr(0, 32)) +
                   "\" is not known (mono, rgb, bgr, rgba, bgra and bayer of 8 and 16 bits are)");
}

// The rows of a message as a matrix of its own, in this machine's byte order.
cv::Mat samples_of(const ImageMessage& message, const Encoding& encoding) {
  const int type = CV_MAKETYPE(encoding.bytes == 2 ? CV_16U : CV_8U, encoding.samples);
  cv::Mat samples(static_cast<int>(message.height), static_cast<int>(message.width), type);
  const std::size_t row_size = samples.cols * samples.elemSize();
  for (std::uint32_t y = 0; y < message.height; ++y) {
    std::memcpy(samples.ptr(static_cast<int>(y)), &message.data[std::size_t{y} * message.step],
                row_size);
  }
  if (encoding.bytes == 2 && message.big_endian != (std::endian::native == std::endian::big)) {
    auto* const values = samples.ptr<std::uint16_t>();
    for (std::size_t i = 0; i < samples.total() * static_cast<std::size_t>(encoding.samples); ++i) {
      values[i] = static_cast<std::uint16_t>(values[i] << 8 | values[i] >> 8);
    }
  }
  return samples;
}

void fill(const cv::Mat& samples, const Encoding& encoding, GrayChannel channel,
          DecodedImage& image) {
  const auto stride = static_cast<std::size_t>(samples.channels());
  const std::size_t count = image.gray.pixels.size();
  const auto red = static_cast<std::size_t>(encoding.red);
  const auto blue = static_cast<std::size_t>(encoding.blue);
  if (encoding.bytes == 2) {
    image.make_wide(stride == 1 ? 1 : 3);
    const auto* in = samples.ptr<std::uint16_t>();
    auto out = image.samples.begin();
    for (std::size_t i = 0; i < count; ++i, in += stride) {
      if (stride == 1) {
        *out++ = in[0];
      } else {
        *out++ = in[red], *out++ = in[1], *out++ = in[blue];
      }
    }
    return;
  }
  const auto* in = samples.ptr<std::uint8_t>();
  for (std::size_t i = 0; i < count; ++i, in += stride) {
    image.gray.pixels[i] = stride == 1 ? in[0] : gray_of(in[red], in[1], in[blue], channel);
  }
}

}  // namespace

DecodedImage decode_raw_image(const ImageMessage& message, const std::string& name,
                              std::optional<ImageSize> expected, GrayChannel channel) {
  Encoding encoding = find_encoding(message.encoding, name);
  const std::uint64_t row =
      std::uint64_t{message.width} * static_cast<std::uint64_t>(encoding.bytes * encoding.samples);
  // The last row need not be padded.
  const std::uint64_t needed =
      message.height == 0 ? 0 : std::uint64_t{message.step} * (message.height - 1) + row;
  if (message.step < row || message.data.size() < needed) {
    throw InputError(name + ": image is " + std::to_string(message.width) + "x" +
                     std::to_string(message.height) + " " + std::string(encoding.name) +
                     ", but its data are too short");
  }
  DecodedImage image;
  make_room_for(expected, name)(message.width, message.height, image.gray);
  cv::Mat samples = samples_of(message, encoding);
  if (encoding.bayer >= 0) {
    if (message.width < 2 || message.height < 2) throw InputError(name + ": no Bayer pattern");
    cv::Mat colors;
    cv::cvtColor(samples, colors, encoding.bayer);
    samples = colors;
    encoding.red = 2;
  }
  fill(samples, encoding, channel, image);
  return image;
}

}  // namespace hybrid_slam
