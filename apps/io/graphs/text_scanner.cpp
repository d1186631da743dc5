#include "apps/io/graphs/text_scanner.h"

#include <algorithm>
#include <charconv>

#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace {

constexpr std::string_view kBlanks = " \t\r,";
constexpr std::string_view kSeparators = " \t\r,\n";

}  // namespace

TextScanner::TextScanner(std::filesystem::path path)
    : path_(std::move(path)), text_(read_text_file(path_)) {}

bool TextScanner::more_on_line() {
  at_ = std::min(text_.find_first_not_of(kBlanks, at_), text_.size());
  return at_ < text_.size() && text_[at_] != '\n';
}

bool TextScanner::more() {
  for (;;) {
    const bool found = more_on_line();
    if (found && !(line_is_untouched_ && text_[at_] == '#')) return true;
    if (!next_line()) return false;
  }
}

bool TextScanner::next_line() {
  const std::size_t end = text_.find('\n', at_);
  if (end == std::string::npos) {
    at_ = text_.size();
    return false;
  }
  at_ = line_begin_ = end + 1;
  ++line_;
  line_is_untouched_ = true;
  return true;
}

std::string_view TextScanner::field(std::string_view what) {
  if (!more_on_line()) fail(std::string(what) + " is missing");
  const std::size_t begin = at_;
  at_ = std::min(text_.find_first_of(kSeparators, begin), text_.size());
  line_is_untouched_ = false;
  return std::string_view(text_).substr(begin, at_ - begin);
}

double TextScanner::number(std::string_view what) {
  return parse_number(field(what), path_, line_);
}

std::uint64_t TextScanner::integer(std::string_view what, std::uint64_t max) {
  const std::string_view digits = field(what);
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    fail(std::string(what) + ": " + quote(digits) + " is not a whole number from 0");
  }
  if (value > max) {
    fail(std::string(what) + ": " + std::to_string(value) + " is above " + std::to_string(max));
  }
  return value;
}

bool TextScanner::skip_field(std::string_view expected) {
  if (!more_on_line()) return false;
  const std::size_t end = std::min(text_.find_first_of(kSeparators, at_), text_.size());
  if (std::string_view(text_).substr(at_, end - at_) != expected) return false;
  at_ = end;
  line_is_untouched_ = false;
  return true;
}

std::string_view TextScanner::whole_line() const {
  const std::size_t begin = std::min(text_.find_first_not_of(kBlanks, line_begin_), text_.size());
  const std::size_t end = std::min(text_.find('\n', begin), text_.size());
  const std::string_view line = std::string_view(text_).substr(begin, end - begin);
  return line.substr(0, line.find_last_not_of(kBlanks) + 1);
}

std::string_view TextScanner::rest_of_line() {
  if (!more_on_line()) return {};
  const std::size_t begin = at_;
  at_ = std::min(text_.find('\n', begin), text_.size());
  line_is_untouched_ = false;
  const std::string_view rest = std::string_view(text_).substr(begin, at_ - begin);
  return rest.substr(0, rest.find_last_not_of(kBlanks) + 1);
}

void TextScanner::expect_end_of_line() {
  if (more_on_line()) fail("expected the end of the line, found " + quote(field("")));
}

void TextScanner::expect_end_of_file() {
  if (more()) fail("expected the end of the file, found " + quote(field("")));
}

void TextScanner::expect_room_for(std::uint64_t count, std::uint64_t bytes,
                                  std::string_view what) const {
  if (count > (text_.size() - at_) / bytes) {
    fail("promises " + std::to_string(count) + " " + std::string(what) +
         ", more than the file can hold");
  }
}

void TextScanner::fail(std::string_view reason) const { throw line_error(path_, line_, reason); }

}  // namespace hybrid_slam
