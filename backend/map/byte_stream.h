#pragma once

#include <bit>
#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "cameras/files/input_error.h"

namespace hybrid_slam {

// Numbers as bytes: little endian, of fixed width, the same on every machine.

template <typename T>
concept StoredNumber = (std::integral<T> || std::floating_point<T>)&&!std::same_as<T, bool>;

template <StoredNumber T>
using StoredBits = std::conditional_t<
    sizeof(T) == 1, std::uint8_t,
    std::conditional_t<sizeof(T) == 2, std::uint16_t,
                       std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;

class ByteWriter {
 public:
  template <StoredNumber T>
  void number(T value) {
    const auto bits = std::bit_cast<StoredBits<T>>(value);
    char bytes[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = static_cast<char>(bits >> (8 * i));
    content_.append(bytes, sizeof(T));
  }

  void bytes(std::string_view bytes) { content_.append(bytes); }

  void text(std::string_view text) {  // its length goes before it
    number(static_cast<std::uint64_t>(text.size()));
    bytes(text);
  }

  const std::string& content() const { return content_; }
  void clear() { content_.clear(); }

 private:
  std::string content_;
};

// Reads what ByteWriter wrote, of which nothing is trusted: whatever does not fit throws
// InputError("place: reason").
class ByteReader {
 public:
  // The content must outlive the reader.
  ByteReader(std::string_view content, std::string place)
      : left_(content), place_(std::move(place)) {}

  template <StoredNumber T>
  T number() {
    const std::string_view taken = bytes(sizeof(T));
    StoredBits<T> bits = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bits = static_cast<StoredBits<T>>(bits | StoredBits<T>{static_cast<std::uint8_t>(taken[i])}
                                                   << (8 * i));
    }
    return std::bit_cast<T>(bits);
  }

  std::string_view bytes(std::size_t count) {
    if (count > left_.size()) fail("ends early");
    const std::string_view taken = left_.substr(0, count);
    left_.remove_prefix(count);
    return taken;
  }

  std::string text() { return std::string(bytes(count<std::uint64_t>(1))); }

  // A number of elements, each of at least `size` bytes, that are still to come. Never more than
  // the bytes that are left can hold, so that it is safe to allocate.
  template <std::unsigned_integral T>
  std::size_t count(std::size_t size) {
    const T count = number<T>();
    if (count > left_.size() / size) fail("a count is larger than the data that follow");
    return static_cast<std::size_t>(count);
  }

  bool at_end() const { return left_.empty(); }
  std::size_t size_left() const { return left_.size(); }

  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(place_ + ": " + reason);
  }

 private:
  std::string_view left_;
  std::string place_;
};

}  // namespace hybrid_slam
