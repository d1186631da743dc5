#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "cameras/files/input_error.h"

namespace hybrid_slam {

// A text file as fields between white space (commas count as such), read once from front to back.
// Lines that begin with # are comments. Every complaint is an InputError with file and line.
class TextScanner {
 public:
  explicit TextScanner(std::filesystem::path path);

  // Whether there is another field on this line.
  bool more_on_line();
  // The same for the rest of the file; goes on to the line that has it.
  bool more();
  // On to the start of the next line, blank or not. False if there is none.
  bool next_line();

  // The next field on this line. `what` it is meant to be, for the complaint that it is missing.
  std::string_view field(std::string_view what);
  // The same as a finite number.
  double number(std::string_view what);
  // The same as a whole number from 0 to `max`.
  std::uint64_t integer(std::string_view what, std::uint64_t max = UINT64_MAX);
  // Passes over the next field on this line if it is this one.
  bool skip_field(std::string_view expected);
  // All of this line, as it stands there, without blanks around it.
  std::string_view whole_line() const;
  // What remains of the line, without blanks around it.
  std::string_view rest_of_line();

  // Complains unless nothing more follows on this line, or in this file.
  void expect_end_of_line();
  void expect_end_of_file();

  // Complains if the rest of the file is too short for `count` items of `bytes` each. To be called
  // before memory is asked for a count that was read.
  void expect_room_for(std::uint64_t count, std::uint64_t bytes, std::string_view what) const;

  int line() const { return line_; }
  const std::filesystem::path& path() const { return path_; }
  [[noreturn]] void fail(std::string_view reason) const;

 private:
  std::filesystem::path path_;
  std::string text_;
  std::size_t at_ = 0;
  std::size_t line_begin_ = 0;
  int line_ = 1;
  bool line_is_untouched_ = true;  // no field of it was read
};

}  // namespace hybrid_slam
