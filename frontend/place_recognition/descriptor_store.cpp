#include "frontend/place_recognition/descriptor_store.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>

#include "cameras/files/output_file.h"

namespace hybrid_slam {

DescriptorStore::DescriptorStore(const std::filesystem::path& folder) : folder_(folder) {
  std::string name = (folder / "descriptors.XXXXXX").string();
  file_ = mkstemp(name.data());
  if (file_ < 0) fail();
  unlink(name.c_str());
}

DescriptorStore::~DescriptorStore() {
  if (mapped_ != nullptr) munmap(mapped_, size_ * sizeof(Descriptor));
  close(file_);
}

void DescriptorStore::fail() const {
  throw OutputError(folder_.string() + ": temporary file of descriptors: " + std::strerror(errno));
}

void DescriptorStore::append(std::span<const Descriptor> descriptors) {
  if (mapped_ != nullptr) throw std::logic_error("descriptor store: append after map");
  const char* at = reinterpret_cast<const char*>(descriptors.data());
  std::size_t left = descriptors.size_bytes();
  while (left > 0) {
    const ssize_t written = write(file_, at, left);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail();
    at += written;
    left -= static_cast<std::size_t>(written);
  }
  size_ += descriptors.size();
}

std::span<Descriptor> DescriptorStore::map() {
  if (size_ == 0) return {};
  if (mapped_ == nullptr) {
    void* mapped =
        mmap(nullptr, size_ * sizeof(Descriptor), PROT_READ | PROT_WRITE, MAP_SHARED, file_, 0);
    if (mapped == MAP_FAILED) fail();
    mapped_ = mapped;
  }
  return {static_cast<Descriptor*>(mapped_), size_};
}

}  // namespace hybrid_slam
