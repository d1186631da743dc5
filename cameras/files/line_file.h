#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace hybrid_slam {

// A text file that grows line by line while a program runs. Each line is with the operating system
// when append() returns, whatever becomes of the program. Never holds half a line that is followed
// by another one. One thread at a time.
class LineFile {
 public:
  LineFile() = default;  // no file: append() does nothing

  // An empty file; an older one is gone. Throws OutputError.
  explicit LineFile(std::filesystem::path path);
  ~LineFile();
  LineFile(LineFile&& other) noexcept { *this = std::move(other); }
  LineFile& operator=(LineFile&& other) noexcept;

  // Adds the text and a line's end. What cannot be written, the disk being full, say, is left out,
  // and later lines are tried again. Returns what went wrong in one line, file and reason, the
  // first time that something does, else nothing.
  std::string append(std::string_view line);

  // Lines that are missing.
  std::size_t left_out() const { return left_out_; }

 private:
  std::filesystem::path path_;
  int file_ = -1;
  std::size_t left_out_ = 0;
};

}  // namespace hybrid_slam
