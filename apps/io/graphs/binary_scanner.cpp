#include "apps/io/graphs/binary_scanner.h"

#include <bit>

#include "frontend/input/text_file.h"

namespace hybrid_slam {

static_assert(std::endian::native == std::endian::little, "numbers are taken as they lie");

BinaryScanner::BinaryScanner(std::filesystem::path path)
    : path_(std::move(path)), content_(read_file(path_)) {}

std::string_view BinaryScanner::take(std::size_t bytes) {
  if (content_.size() - at_ < bytes) fail_at(at_, "the file ends too early");
  at_ += bytes;
  return std::string_view(content_).substr(at_ - bytes, bytes);
}

std::string_view BinaryScanner::text() {
  const std::size_t end = content_.find('\0', at_);
  if (end == std::string::npos) fail_at(at_, "the file ends within a text");
  const std::string_view result = take(end - at_);
  ++at_;
  return result;
}

void BinaryScanner::check_room(std::uint64_t count, std::uint64_t bytes, std::size_t width,
                               std::string_view what) const {
  if (count > (content_.size() - at_) / bytes) {
    fail_at(at_ - width, "promises " + std::to_string(count) + " " + std::string(what) +
                             ", more than the file can hold");
  }
}

void BinaryScanner::expect_end_of_file() const {
  if (at_ != content_.size()) {
    fail_at(at_, "expected the end of the file, found " + std::to_string(content_.size() - at_) +
                     " more bytes");
  }
}

void BinaryScanner::fail_at(std::uint64_t byte, std::string_view reason) const {
  throw InputError(path_.string() + ": byte " + std::to_string(byte) + ": " + std::string(reason));
}

}  // namespace hybrid_slam
