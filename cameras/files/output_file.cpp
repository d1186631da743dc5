#include "cameras/files/output_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace hybrid_slam {

OutputFile::OutputFile(const std::filesystem::path& path)
    : path_(path), temporary_(path.string() + ".XXXXXX") {
  descriptor_ = mkstemp(temporary_.data());
  if (descriptor_ < 0) fail();
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) close(descriptor_);
  if (!committed_) unlink(temporary_.c_str());
}

void OutputFile::write(std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(descriptor_, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail();
    content.remove_prefix(static_cast<std::size_t>(written));
  }
}

void OutputFile::commit() {
  // mkstemp makes a file for its owner alone; results get what the user's mask allows.
  const mode_t mask = umask(0);
  umask(mask);
  if (fchmod(descriptor_, 0666 & ~mask) != 0 || fsync(descriptor_) != 0) fail();
  const int closed = close(descriptor_);
  descriptor_ = -1;
  if (closed != 0 || rename(temporary_.c_str(), path_.c_str()) != 0) fail();
  committed_ = true;
  sync_folder();
}

// The content is safe by now; this makes the new name survive a power cut.
void OutputFile::sync_folder() const {
  const std::string folder = path_.has_parent_path() ? path_.parent_path().string() : ".";
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;  // a folder may allow new files and not be readable
  const bool failed = fsync(descriptor) != 0 && errno != EINVAL;  // EINVAL: cannot be synced
  const int reason = errno;
  close(descriptor);
  errno = reason;
  if (failed) fail();
}

void OutputFile::fail() const {
  throw OutputError(path_.string() + ": cannot be written: " + std::strerror(errno));
}

std::filesystem::path make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw OutputError(folder.string() + ": cannot be made: " + error.message());
  }
  return folder;
}

void write_file(const std::filesystem::path& path, std::string_view content) {
  OutputFile file(path);
  file.write(content);
  file.commit();
}

}  // namespace hybrid_slam
