#pragma once

#include "frontend/input/bags/messages.h"
#include "frontend/input/image_decoders.h"

namespace hybrid_slam {

// The pixels of a sensor_msgs/Image: mono8, mono16, rgb8, bgr8, rgba8, bgra8, their 16-bit kinds,
// bayer_{rggb,bggr,gbrg,grbg}{8,16} (interpolated between neighbours) and OpenCV's names 8UC1,
// 16UC1, 8UC3 and 8UC4 (blue, green, red). Throws InputError, beginning with `name`, for other
// encodings, data too short, or a size that is not the expected one.
DecodedImage decode_raw_image(const ImageMessage& message, const std::string& name,
                              std::optional<ImageSize> expected, GrayChannel channel);

}  // namespace hybrid_slam
