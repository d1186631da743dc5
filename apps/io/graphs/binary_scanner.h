#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <type_traits>

#include "cameras/files/input_error.h"

namespace hybrid_slam {

// A little-endian binary file, read once from front to back. Every complaint is an InputError with
// file and byte.
class BinaryScanner {
 public:
  explicit BinaryScanner(std::filesystem::path path);

  // Floating-point numbers must be finite.
  template <typename T>
  T read() {
    static_assert(std::is_arithmetic_v<T>);
    T value;
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    if constexpr (std::is_floating_point_v<T>) {
      if (!std::isfinite(value)) fail_at(at_ - sizeof(T), "a number that is not finite");
    }
    return value;
  }

  // Up to the next zero byte.
  std::string_view text();

  // A count of items of at least `bytes` each. Complains if the rest of the file cannot hold them.
  template <typename T>
  std::uint64_t count(std::uint64_t bytes, std::string_view what) {
    const T value = read<T>();
    check_room(value, bytes, sizeof(T), what);
    return value;
  }

  void expect_end_of_file() const;

  std::uint64_t at() const { return at_; }
  [[noreturn]] void fail_at(std::uint64_t byte, std::string_view reason) const;

 private:
  std::string_view take(std::size_t bytes);
  void check_room(std::uint64_t count, std::uint64_t bytes, std::size_t width,
                  std::string_view what) const;

  std::filesystem::path path_;
  std::string content_;
  std::size_t at_ = 0;
};

}  // namespace hybrid_slam
