#pragma once

#include <string>

#include "frontend/input/bags/byte_cursor.h"

namespace hybrid_slam {

// Whether a chunk with this compression lies in the file as it is.
bool is_stored(const std::string& compression);

// Whether it can be decompressed: bz2 (ROS 1), lz4 (both), zstd (MCAP).
bool is_known_compression(const std::string& compression);

// The bytes of a compressed chunk, of which there are `size`. Throws InputError, beginning with
// `source`, if the compression is unknown or the data are damaged.
ByteVector decompress(const std::string& compression, ByteView data, std::uint64_t size,
                      const std::string& source);

// Whether a message was compressed by itself, as rosbag2's compression_mode "message" does.
bool is_zstd_frame(ByteView data);
ByteVector decompress_zstd_frame(ByteView data, const std::string& source);

}  // namespace hybrid_slam
