#pragma once

#include <map>
#include <optional>

#include "frontend/input/bags/bag.h"
#include "frontend/input/bags/chunked_file.h"

namespace hybrid_slam {

// What ROS 1 bags and MCAP have in common: records one after the other, some in chunks, each chunk
// followed by records that tell where in it which messages begin. One walk from record to record
// finds all; only chunks without such an index are read then.
class ChunkedBag : public Bag {
 protected:
  explicit ChunkedBag(const std::filesystem::path& path) : Bag(path.string()), file_(path) {}

  // Where in the file the index of one chunk's messages on one channel lies.
  struct IndexPart {
    std::uint32_t channel = 0;
    std::uint64_t offset = 0;  // in the file
    std::uint64_t count = 0;   // entries
  };
  // An entry of an index: its size, and the message's record it tells of, counted in the chunk.
  struct IndexEntry {
    std::uint64_t size = 0;
    std::uint64_t (*offset_of)(ByteCursor& entry) = nullptr;
  };

  // A record, as far as its beginning tells.
  struct Record {
    std::uint32_t chunk = ChunkedFile::kNoChunk;  // in which it lies
    std::uint64_t begin = 0;                      // there
    std::uint64_t data = 0;
    std::uint64_t end = 0;  // may lie beyond what there is
    std::uint8_t op = 0;    // what it is, by the format's numbers
    ByteVector header;      // the fields before the data, where the format has some

    bool is_in_file() const { return chunk == ChunkedFile::kNoChunk; }
    std::uint64_t size() const { return end - data; }
  };

  // From the record at `offset` on, or from the beginning of a chunk, up to `end`.
  void walk(std::uint32_t chunk, std::uint64_t offset, std::uint64_t end);

  // Of either format, for walk(). A record, or none if it is cut off or cannot be one.
  virtual std::optional<Record> read_head(std::uint32_t chunk, std::uint64_t offset,
                                          std::uint64_t end) = 0;
  // A chunk in the file, which may be cut off, or none if it is no chunk or nothing is left of it.
  virtual std::optional<Chunk> chunk_of(const Record& record) = 0;
  // Any record that is whole: calls the functions below.
  virtual void meet(const Record& record) = 0;

  void add_index(const IndexPart& part);
  void add_channel(std::uint32_t channel, std::uint32_t topic) { channels_[channel] = topic; }
  bool knows_channel(std::uint32_t channel) const { return channels_.contains(channel); }
  void add_message_of(std::uint32_t channel, const Record& record);

  // After the walk through the file. Where that is not complete, the last chunk is read, as its
  // index may be missing in part. Throws InputError if chunks are of an unknown compression.
  void index_chunks(const IndexEntry& entry, bool is_complete);

  const ChunkedFile& file() const { return file_; }
  bool is_cut_off() const { return cut_off_; }

 private:
  void add_chunk(Chunk chunk);
  bool is_indexed(std::uint32_t chunk) const;
  void scan(std::uint32_t chunk);
  void read_index(std::uint32_t chunk, const IndexEntry& entry);

  ChunkedFile file_;
  std::vector<std::vector<IndexPart>> indices_;      // by chunk
  std::map<std::uint32_t, std::uint32_t> channels_;  // to topics
  bool cut_off_ = false;
};

}  // namespace hybrid_slam
