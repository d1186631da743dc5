#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace hybrid_slam {

// A result could not be written. what() is one line: file, reason.
class OutputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Makes a folder, and those above it, unless it is there. Returns it. Throws OutputError.
std::filesystem::path make_folder(const std::filesystem::path& folder);

// A file that is written whole or not at all: into a temporary file beside it ("NAME.XXXXXX"),
// which takes its name at commit(). A reader never sees half a file, and an older one survives a
// failure, a killed program and a power cut. Without commit() nothing is left behind, unless the
// program is killed: then the temporary file stays. Every function throws OutputError.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(std::string_view content);
  void commit();  // once, at the end

 private:
  [[noreturn]] void fail() const;
  void sync_folder() const;

  std::filesystem::path path_;
  std::string temporary_;
  int descriptor_ = -1;
  bool committed_ = false;
};

// An OutputFile of this content.
void write_file(const std::filesystem::path& path, std::string_view content);

}  // namespace hybrid_slam
