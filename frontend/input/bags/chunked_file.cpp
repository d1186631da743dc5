#include "frontend/input/bags/chunked_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cerrno>

#include "frontend/input/bags/chunk_codec.h"

namespace hybrid_slam {

ChunkedFile::ChunkedFile(const std::filesystem::path& path) : name_(path.string()) {
  file_ = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (file_ < 0 || fstat(file_, &status) != 0 || !S_ISREG(status.st_mode)) {
    if (file_ >= 0) close(file_);
    throw InputError(name_ + ": cannot be read");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

ChunkedFile::~ChunkedFile() { close(file_); }

std::uint32_t ChunkedFile::add_chunk(Chunk chunk) {
  chunks_.push_back(std::move(chunk));
  return static_cast<std::uint32_t>(chunks_.size() - 1);
}

ByteVector ChunkedFile::read(std::uint64_t offset, std::uint64_t count) const {
  ByteVector bytes(offset < size_ ? std::min(count, size_ - offset) : 0);
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got =
        pread(file_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw InputError(name_ + ": cannot be read");
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

ByteVector ChunkedFile::read(std::uint32_t chunk, std::uint64_t offset, std::uint64_t count) const {
  if (chunk == kNoChunk) return read(offset, count);
  const Chunk& place = chunks_.at(chunk);
  if (is_stored(place.compression)) {
    const std::uint64_t left = offset < place.stored_size ? place.stored_size - offset : 0;
    return read(place.offset + offset, std::min(count, left));
  }
  const auto whole = decompressed(chunk);
  const ByteView bytes = whole->bytes;
  const std::size_t from = std::min<std::uint64_t>(offset, bytes.size());
  const ByteView part = bytes.subspan(from, std::min<std::uint64_t>(count, bytes.size() - from));
  return {part.begin(), part.end()};
}

std::shared_ptr<const ChunkedFile::Decompressed> ChunkedFile::decompressed(
    std::uint32_t chunk) const {
  if (auto last = last_.load(); last && last->chunk == chunk) return last;
  const Chunk& place = chunks_.at(chunk);
  auto result = std::make_shared<Decompressed>();
  result->chunk = chunk;
  result->bytes =
      decompress(place.compression, read(place.offset, place.stored_size), place.size, name_);
  const auto crc = crc32_z(0, result->bytes.data(), result->bytes.size());
  if (place.crc != 0 && crc != place.crc) {
    throw InputError(name_ + ": a chunk is damaged: its checksum differs");
  }
  last_.store(result);
  return result;
}

}  // namespace hybrid_slam
