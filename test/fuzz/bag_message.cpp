#include "frontend/input/bags/camera_info.h"
#include "frontend/input/bags/messages.h"
#include "frontend/input/bags/raw_image.h"
#include "test/fuzz/fuzz_target.h"

// A message's bytes as they lie in a bag. The first byte tells its serialisation.
void hybrid_slam::read_input(std::string_view input) {
  if (input.empty()) return;
  const auto serialization = input[0] == '1' ? Serialization::kRos1 : Serialization::kCdr;
  input.remove_prefix(1);
  const MessageBytes message{{reinterpret_cast<const std::uint8_t*>(input.data()), input.size()},
                             serialization,
                             "message"};
  try_reading([&] { read_stamp(message); });
  for (const GrayChannel channel : {GrayChannel::kGrey, GrayChannel::kRed}) {
    try_reading([&] {
      to_gray(decode_raw_image(read_image_message(message), "image", std::nullopt, channel),
              {channel, 0});
    });
  }
  try_reading([&] {
    decode_image(read_compressed_image(message), "image", std::nullopt, GrayChannel::kGrey);
  });
  const CameraInfoMessage info = read_camera_info(message);
  try_reading([&] { is_rectified(info); });
  try_reading([&] { fisheye_camera(info, "bag"); });
  CameraInfoMessage right = info;
  right.p[3] -= 1;
  try_reading([&] { rectified_pair(info, right, "bag"); });
  try_reading([&] { raw_pair(info, right, "bag"); });
}
