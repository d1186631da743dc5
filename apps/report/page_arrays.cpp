#include "apps/report/page_arrays.h"

#include <algorithm>

namespace hybrid_slam {

std::string base64(const void* data, std::size_t size) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* bytes = static_cast<const unsigned char*>(data);
  std::string text;
  text.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const unsigned first = bytes[i];
    const unsigned second = i + 1 < size ? bytes[i + 1] : 0u;
    const unsigned third = i + 2 < size ? bytes[i + 2] : 0u;
    const unsigned bits = first << 16 | second << 8 | third;
    text += kDigits[bits >> 18 & 63];
    text += kDigits[bits >> 12 & 63];
    text += i + 1 < size ? kDigits[bits >> 6 & 63] : '=';
    text += i + 2 < size ? kDigits[bits & 63] : '=';
  }
  return text;
}

std::vector<std::size_t> evenly(std::size_t count, std::size_t wanted) {
  std::vector<std::size_t> places;
  const std::size_t taken = std::min(count, wanted);
  for (std::size_t i = 0; i < taken; ++i) places.push_back(i * count / taken);
  return places;
}

}  // namespace hybrid_slam
