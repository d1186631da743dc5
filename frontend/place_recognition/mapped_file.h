#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>

namespace hybrid_slam {

// A file as read-only memory, whose pages come when they are touched. The file must stay as long as
// it is: replaced by another of the same name, yes; cut off while it is read, no.
class MappedFile {
 public:
  // Throws InputError if there is no such file or if it is empty.
  explicit MappedFile(const std::filesystem::path& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::string_view bytes() const { return {static_cast<const char*>(data_), size_}; }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace hybrid_slam
