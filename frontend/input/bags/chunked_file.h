#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontend/input/bags/byte_cursor.h"

namespace hybrid_slam {

// A piece of a file that holds messages, perhaps compressed.
struct Chunk {
  std::uint64_t offset = 0;       // of its data in the file
  std::uint64_t stored_size = 0;  // [bytes] in the file; less than written where that was cut off
  std::uint64_t size = 0;         // [bytes] decompressed
  std::string compression;
  std::uint32_t crc = 0;  // CRC32 of the decompressed bytes; 0: not told
};

// A file read in pieces, never as a whole. Safe to use from several threads once all chunks were
// added.
class ChunkedFile {
 public:
  static constexpr std::uint32_t kNoChunk = ~std::uint32_t{0};

  explicit ChunkedFile(const std::filesystem::path& path);  // throws InputError
  ~ChunkedFile();
  ChunkedFile(const ChunkedFile&) = delete;
  ChunkedFile& operator=(const ChunkedFile&) = delete;

  const std::string& name() const { return name_; }
  std::uint64_t size() const { return size_; }
  const std::vector<Chunk>& chunks() const { return chunks_; }
  std::uint32_t add_chunk(Chunk chunk);

  // Up to `count` bytes from `offset` on; fewer at the end. Throws InputError if reading fails.
  ByteVector read(std::uint64_t offset, std::uint64_t count) const;

  // The same, where `chunk` may be kNoChunk for the file itself; the offset is counted in the
  // decompressed chunk. The chunk that was decompressed last is kept. Throws InputError if it is
  // damaged.
  ByteVector read(std::uint32_t chunk, std::uint64_t offset, std::uint64_t count) const;

 private:
  struct Decompressed {
    std::uint32_t chunk = kNoChunk;
    ByteVector bytes;
  };
  std::shared_ptr<const Decompressed> decompressed(std::uint32_t chunk) const;

  std::string name_;
  int file_ = -1;
  std::uint64_t size_ = 0;
  std::vector<Chunk> chunks_;
  mutable std::atomic<std::shared_ptr<const Decompressed>> last_;
};

}  // namespace hybrid_slam
