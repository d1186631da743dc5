#include "frontend/input/bags/chunked_bag.h"

// MCAP (mcap.dev/spec): after a magic of 8 bytes, records of an opcode, a 64-bit length and
// content. All numbers are little endian.
namespace hybrid_slam {

namespace {

constexpr std::uint64_t kMagic = 8;            // [bytes]
constexpr std::uint64_t kRecordHead = 9;       // [bytes] opcode and length
constexpr std::uint64_t kMessageHead = 22;     // [bytes] channel, number and two times
constexpr std::uint64_t kIndexHead = 6;        // [bytes] channel and the entries' size
constexpr std::uint64_t kMcapIndexEntry = 16;  // [bytes] time of receipt and offset

Serialization serialization_of(std::string_view encoding) {
  return encoding == "cdr"    ? Serialization::kCdr
         : encoding == "ros1" ? Serialization::kRos1
                              : Serialization::kOther;
}

class McapBag final : public ChunkedBag {
 public:
  explicit McapBag(const std::filesystem::path& path) : ChunkedBag(path) {
    walk(ChunkedFile::kNoChunk, kMagic, file().size());
    if (!is_closed_ && !is_cut_off()) warn("was not closed; what it holds is read");
    index_chunks({.size = kMcapIndexEntry,
                  .offset_of =
                      [](ByteCursor& entry) {
                        entry.take<std::uint64_t>();  // time of receipt
                        return entry.take<std::uint64_t>();
                      }},
                 is_closed_);
  }

 private:
  enum Op : std::uint8_t {
    kClosingMagic = 0,
    kFooter = 2,
    kSchema = 3,
    kChannel = 4,
    kMessage = 5,
    kChunk = 6,
    kMessageIndex = 7
  };

  ByteVector read_stored(const BagMessage& message, std::uint64_t most) const override {
    const auto record = head_at(message.chunk, message.offset);
    if (record && record->op == kMessage && record->size() >= kMessageHead) {
      const std::uint64_t count = std::min(record->size() - kMessageHead, most);
      ByteVector bytes = file().read(message.chunk, record->data + kMessageHead, count);
      if (bytes.size() == count) return bytes;
    }
    throw InputError(name() + ": a message is cut off or damaged");
  }

  std::optional<Record> head_at(std::uint32_t chunk, std::uint64_t offset) const {
    const ByteVector head = file().read(chunk, offset, kRecordHead);
    if (head.size() < kRecordHead) return std::nullopt;
    ByteCursor cursor(head, name());
    Record record{chunk, offset, offset + kRecordHead, 0, cursor.take<std::uint8_t>(), {}};
    const auto size = cursor.take<std::uint64_t>();
    if (record.op == 0 || size > std::numeric_limits<std::uint64_t>::max() - record.data) {
      return std::nullopt;
    }
    record.end = record.data + size;
    return record;
  }

  std::optional<Record> read_head(std::uint32_t chunk, std::uint64_t offset,
                                  std::uint64_t end) override {
    if (!is_closed_ || chunk != ChunkedFile::kNoChunk) return head_at(chunk, offset);
    if (end - offset != kMagic) return std::nullopt;
    return Record{chunk, offset, offset, end, kClosingMagic, {}};
  }

  std::optional<Chunk> chunk_of(const Record& record) override {
    if (record.op != kChunk) return std::nullopt;
    constexpr std::uint64_t kMost = 8 + 8 + 8 + 4 + 4 + 64 + 8;  // before the records
    const ByteVector start = file().read(record.data, std::min(kMost, record.size()));
    ByteCursor cursor(start, name());
    Chunk chunk;
    try {
      cursor.take_bytes(16);  // first and last time of receipt
      chunk.size = cursor.take<std::uint64_t>();
      chunk.crc = cursor.take<std::uint32_t>();
      chunk.compression = cursor.take_text();
      chunk.stored_size = cursor.take<std::uint64_t>();
    } catch (const InputError&) {  // cut off before its records
      return std::nullopt;
    }
    chunk.offset = record.data + cursor.at();
    return chunk;
  }

  void meet(const Record& record) override {
    if (record.op == kSchema || record.op == kChannel) {
      const ByteVector bytes = file().read(record.chunk, record.data, record.size());
      record.op == kSchema ? meet_schema(bytes) : meet_channel(bytes);
    } else if (record.op == kMessage) {
      if (record.size() < kMessageHead) throw InputError(name() + ": a message is too short");
      const ByteVector channel = file().read(record.chunk, record.data, 2);
      add_message_of(ByteCursor(channel, name()).take<std::uint16_t>(), record);
    } else if (record.op == kMessageIndex && record.is_in_file() && record.size() >= kIndexHead) {
      const ByteVector start = file().read(record.data, kIndexHead);
      ByteCursor index(start, name());
      const auto channel = index.take<std::uint16_t>();
      const auto size = std::min<std::uint64_t>(index.take<std::uint32_t>(),
                                                record.size() - kIndexHead);  // [bytes]
      add_index({channel, record.data + kIndexHead, size / kMcapIndexEntry});
    } else if (record.op == kFooter && record.is_in_file()) {
      is_closed_ = true;
    }
  }

  void meet_schema(ByteView content) {
    ByteCursor cursor(content, name());
    const auto id = cursor.take<std::uint16_t>();
    schemas_[id] = cursor.take_text();
  }

  void meet_channel(ByteView content) {
    ByteCursor cursor(content, name());
    const auto id = cursor.take<std::uint16_t>();
    const auto schema = cursor.take<std::uint16_t>();
    const std::string_view topic = cursor.take_text();
    const std::string_view encoding = cursor.take_text();
    if (!knows_channel(id)) {
      add_channel(id, topic_of(topic, schemas_[schema], serialization_of(encoding)));
    }
  }

  std::map<std::uint32_t, std::string> schemas_;
  bool is_closed_ = false;
};

}  // namespace

std::unique_ptr<const Bag> open_mcap(const std::filesystem::path& path) {
  return std::make_unique<const McapBag>(path);
}

}  // namespace hybrid_slam
