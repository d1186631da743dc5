#include "frontend/place_recognition/mapped_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "cameras/files/input_error.h"

namespace hybrid_slam {

MappedFile::MappedFile(const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) throw InputError(path.string() + ": " + std::strerror(errno));
  struct stat status {};
  const bool regular = fstat(file, &status) == 0 && S_ISREG(status.st_mode);
  size_ = regular ? static_cast<std::size_t>(status.st_size) : 0;
  if (size_ > 0) data_ = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
  const int error = errno;
  close(file);
  if (!regular) throw InputError(path.string() + ": not a file");
  if (size_ == 0) throw InputError(path.string() + ": the file is empty");
  if (data_ == MAP_FAILED) throw InputError(path.string() + ": " + std::strerror(error));
}

MappedFile::~MappedFile() { munmap(data_, size_); }

}  // namespace hybrid_slam
