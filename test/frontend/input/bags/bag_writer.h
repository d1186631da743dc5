#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frontend/input/bags/messages.h"

// Small bags, written byte by byte from the formats' descriptions and by no code of the readers.
namespace hybrid_slam {

// How a message becomes bytes.
struct Wire {
  Serialization serialization = Serialization::kCdr;
  bool big_endian = false;  // of CDR
};

struct TestImage {
  std::int64_t stamp = 0;  // [ns]
  std::uint32_t width = 0, height = 0;
  std::string encoding = "mono8";
  bool big_endian = false;  // of the samples
  std::uint32_t step = 0;
  ByteVector data;
};
ByteVector image_bytes(const Wire& wire, const TestImage& image);
ByteVector compressed_image_bytes(const Wire& wire, std::int64_t stamp, const ByteVector& file);
ByteVector camera_info_bytes(const Wire& wire, std::int64_t stamp, const CameraInfoMessage& info);

struct TestMessage {
  std::string topic;
  std::string type;  // as the format writes it
  ByteVector bytes;
};

struct ChunkWriting {
  std::string compression = "none";
  std::size_t per_chunk = 2;  // messages; of MCAP 0: without chunks
  bool index = true;          // behind each chunk, and the connections at the end
};

void write_ros1_bag(const std::filesystem::path& path, const std::vector<TestMessage>& messages,
                    const ChunkWriting& writing);
void write_mcap(const std::filesystem::path& path, const std::vector<TestMessage>& messages,
                const ChunkWriting& writing, const std::string& encoding = "cdr");
void write_sqlite_bag(const std::filesystem::path& path, const std::vector<TestMessage>& messages);

ByteVector zstd_bytes(const ByteVector& bytes);

}  // namespace hybrid_slam
