#pragma once

#include <algorithm>
#include <string>
#include <string_view>

namespace hybrid_slam {

// Text of a file as it may stand in the one line of an error: control characters are question
// marks.
inline std::string printable(std::string_view text) {
  std::string result(text);
  std::replace_if(
      result.begin(), result.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return result;
}

}  // namespace hybrid_slam
