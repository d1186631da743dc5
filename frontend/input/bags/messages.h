#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "frontend/input/bags/bag.h"

// The fields of ROS' sensor_msgs, from the serialisation of ROS 1 or from CDR (ROS 2; OMG's XCDR1
// in either byte order). All throw InputError, beginning with `source`, if the bytes do not hold
// them.
namespace hybrid_slam {

// What a message lies in.
struct MessageBytes {
  ByteView bytes;
  Serialization serialization = Serialization::kCdr;
  std::string_view source;
};

// Time of the message's header [ns]; needs the first kStampBytes of it.
inline constexpr std::uint64_t kStampBytes = 12;
std::int64_t read_stamp(const MessageBytes& message);

// sensor_msgs/Image. Views the message's bytes.
struct ImageMessage {
  std::uint32_t width = 0, height = 0;  // [px]
  std::string_view encoding;
  bool big_endian = false;
  std::uint32_t step = 0;  // [bytes] from row to row
  ByteView data;
};
ImageMessage read_image_message(const MessageBytes& message);

// sensor_msgs/CompressedImage: its data, a PNG or JPEG file.
ByteView read_compressed_image(const MessageBytes& message);

// sensor_msgs/CameraInfo.
struct CameraInfoMessage {
  std::uint32_t width = 0, height = 0;  // [px]
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};   // 3x3, row by row
  std::array<double, 9> r{};   // rectified_from_raw
  std::array<double, 12> p{};  // 3x4, of the rectified image; P[3] of the right one: -fx * baseline
  std::uint32_t binning_x = 0, binning_y = 0;
  std::uint32_t roi_width = 0, roi_height = 0;  // [px]; 0: the whole image
};
CameraInfoMessage read_camera_info(const MessageBytes& message);

}  // namespace hybrid_slam
