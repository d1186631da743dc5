#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cameras/files/input_error.h"

namespace hybrid_slam {

using ByteView = std::span<const std::uint8_t>;
using ByteVector = std::vector<std::uint8_t>;

inline std::string_view as_text(ByteView bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// How numbers lie in bytes.
struct ByteLayout {
  bool big_endian = false;
  bool aligned = false;  // each number at a multiple of its size, counted from the first byte
};

// Reads bytes from front to back. Throws InputError, beginning with `source`, where they end too
// early. Views the bytes and `source`, which must outlive it.
class ByteCursor {
 public:
  ByteCursor(ByteView bytes, std::string_view source, ByteLayout layout = {})
      : bytes_(bytes), source_(source), layout_(layout) {}

  template <typename T>
  T take() {
    if (layout_.aligned) take_bytes((sizeof(T) - at_ % sizeof(T)) % sizeof(T));
    const ByteView taken = take_bytes(sizeof(T));
    std::uint8_t raw[sizeof(T)];
    std::copy(taken.begin(), taken.end(), raw);
    if (layout_.big_endian != (std::endian::native == std::endian::big)) {
      std::reverse(std::begin(raw), std::end(raw));
    }
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }

  ByteView take_bytes(std::uint64_t count) {
    if (count > left()) throw InputError(std::string(source_) + ": a record ends too early");
    const ByteView taken = bytes_.subspan(at_, count);
    at_ += count;
    return taken;
  }

  // A 32-bit length and as many bytes.
  ByteView take_block() { return take_bytes(take<std::uint32_t>()); }
  std::string_view take_text() { return as_text(take_block()); }

  std::size_t at() const { return at_; }
  std::size_t left() const { return bytes_.size() - at_; }

 private:
  ByteView bytes_;
  std::string_view source_;
  ByteLayout layout_;
  std::size_t at_ = 0;
};

}  // namespace hybrid_slam
