#include <zlib.h>

#include "test/fuzz/fuzz_target.h"

// Changes a PNG and mends its checksums, at which libpng would stop otherwise.
namespace hybrid_slam {
namespace {

std::uint32_t big_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes.substr(0, 4)) value = value << 8 | static_cast<std::uint8_t>(byte);
  return value;
}

void mend_checksums(std::string& png) {
  for (std::size_t at = 8; at + 12 <= png.size();) {
    const std::size_t size = big_endian(std::string_view(png).substr(at));
    if (size > png.size() - at - 12) return;
    const auto* const covered = reinterpret_cast<const Bytef*>(&png[at + 4]);
    const auto crc = static_cast<std::uint32_t>(crc32_z(0, covered, size + 4));
    for (std::size_t i = 0; i < 4; ++i) {
      png[at + 8 + size + i] = static_cast<char>(crc >> (24 - 8 * i));
    }
    at += 12 + size;
  }
}

}  // namespace
}  // namespace hybrid_slam

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned seed) {
  std::string png = hybrid_slam::changed({reinterpret_cast<const char*>(data), size}, most);
  if (seed % 8 != 0) hybrid_slam::mend_checksums(png);
  return hybrid_slam::hand_over(png, data, most);
}
