#include "frontend/input/image_decoders.h"
#include "test/fuzz/fuzz_target.h"

// A file in memory, told by its content: which format is fuzzed is up to the seeds.
void hybrid_slam::read_input(std::string_view input) {
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
  for (const GrayChannel channel : {GrayChannel::kGrey, GrayChannel::kGreen}) {
    to_gray(decode_image(bytes, "image", std::nullopt, channel), {channel, 0});
  }
}
