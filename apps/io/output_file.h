#pragma once

#include <filesystem>
#include <stdexcept>
#include <string_view>

namespace hybrid_slam {

// A result could not be written. what() is one line: file, reason.
class OutputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Makes a folder, and those above it, unless it is there. Returns it. Throws OutputError.
std::filesystem::path make_folder(const std::filesystem::path& folder);

// Writes a file whole or not at all: into a temporary file beside it that takes its name at the
// end. A reader never sees half a file, and an older one survives a failure. Throws OutputError.
void write_file(const std::filesystem::path& path, std::string_view content);

}  // namespace hybrid_slam
