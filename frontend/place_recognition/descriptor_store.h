#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "backend/map/features.h"

namespace hybrid_slam {

// More descriptors than memory holds: in a temporary file without a name, which goes when the store
// or the program does. Throws OutputError where the file cannot be made, grown or mapped.
class DescriptorStore {
 public:
  explicit DescriptorStore(const std::filesystem::path& folder);
  ~DescriptorStore();
  DescriptorStore(const DescriptorStore&) = delete;
  DescriptorStore& operator=(const DescriptorStore&) = delete;

  // Not after map().
  void append(std::span<const Descriptor> descriptors);

  std::uint64_t size() const { return size_; }

  // All of them, as memory that the system takes from the file and writes back to it as it needs.
  std::span<Descriptor> map();

 private:
  [[noreturn]] void fail() const;

  std::filesystem::path folder_;
  int file_ = -1;
  std::uint64_t size_ = 0;  // descriptors
  void* mapped_ = nullptr;
};

}  // namespace hybrid_slam
