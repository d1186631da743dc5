#include "cameras/files/line_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "cameras/files/output_file.h"

namespace hybrid_slam {

LineFile::LineFile(std::filesystem::path path) : path_(std::move(path)) {
  file_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0666);
  if (file_ < 0) throw OutputError(path_.string() + ": " + std::strerror(errno));
}

LineFile::~LineFile() {
  if (file_ >= 0) ::close(file_);
}

LineFile& LineFile::operator=(LineFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(file_, other.file_);
  std::swap(left_out_, other.left_out_);
  return *this;
}

std::string LineFile::append(std::string_view line) {
  if (file_ < 0) return {};
  const std::string text = std::string(line) + '\n';
  const off_t before = ::lseek(file_, 0, SEEK_END);
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t written = ::write(file_, text.data() + done, text.size() - done);
    if (written > 0) {
      done += static_cast<std::size_t>(written);
    } else if (errno != EINTR) {
      break;
    }
  }
  if (done == text.size()) return {};
  const int reason = errno;
  if (done > 0 && before >= 0 && ::ftruncate(file_, before) != 0) {
    ::close(std::exchange(file_, -1));  // half a line stays; nothing shall follow it
  }
  if (left_out_++ > 0) return {};
  return path_.string() + ": " + std::strerror(reason) + "; lines are left out";
}

}  // namespace hybrid_slam
