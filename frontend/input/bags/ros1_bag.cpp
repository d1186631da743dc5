#include "frontend/input/bags/chunked_bag.h"

// ROS 1's bag format 2.0 (wiki.ros.org/Bags/Format/2.0): records of a header, which is a list of
// "name=value", and data; each with a 32-bit length. All numbers are little endian.
namespace hybrid_slam {

namespace {

constexpr std::uint64_t kSignature = 13;  // [bytes]: "#ROSBAG V2.0\n"
constexpr std::uint32_t kMaxHeader = 1 << 20;
constexpr std::uint64_t kRos1IndexEntry = 12;  // [bytes] time of receipt and offset

// The value of a field of a header; none if there is no such field.
std::optional<ByteView> find_field(ByteView header, std::string_view name,
                                   std::string_view source) {
  ByteCursor cursor(header, source);
  while (cursor.left() > 0) {
    const ByteView field = cursor.take_block();
    const std::size_t equals = as_text(field).find('=');
    if (equals != std::string_view::npos && as_text(field).substr(0, equals) == name) {
      return field.subspan(equals + 1);
    }
  }
  return std::nullopt;
}

class Ros1Bag final : public ChunkedBag {
 public:
  explicit Ros1Bag(const std::filesystem::path& path) : ChunkedBag(path) {
    walk(ChunkedFile::kNoChunk, kSignature, file().size());
    const bool was_closed = index_at_ != 0 && index_at_ <= file().size();
    if (!is_cut_off() && !was_closed) {
      warn("was not closed; what it holds is read");
    }
    index_chunks({.size = kRos1IndexEntry,
                  .offset_of =
                      [](ByteCursor& entry) {
                        entry.take<std::uint64_t>();  // time of receipt
                        return std::uint64_t{entry.take<std::uint32_t>()};
                      }},
                 was_closed && !is_cut_off());
  }

 private:
  enum Op : std::uint8_t {
    kMessage = 2,
    kBagHeader = 3,
    kIndex = 4,
    kChunk = 5,
    kChunkInfo = 6,
    kConnection = 7
  };

  ByteVector read_stored(const BagMessage& message, std::uint64_t most) const override {
    const auto record = record_at(message.chunk, message.offset);
    if (record) {
      const std::uint64_t count = std::min(record->size(), most);
      ByteVector bytes = file().read(message.chunk, record->data, count);
      if (bytes.size() == count) return bytes;
    }
    throw InputError(name() + ": a message is cut off");
  }

  // None if its header is cut off or none.
  std::optional<Record> record_at(std::uint32_t chunk, std::uint64_t offset) const {
    const ByteVector length = file().read(chunk, offset, 4);
    if (length.size() < 4) return std::nullopt;
    const auto header_size = ByteCursor(length, name()).take<std::uint32_t>();
    if (header_size == 0 || header_size > kMaxHeader) return std::nullopt;
    ByteVector header = file().read(chunk, offset + 4, std::uint64_t{header_size} + 4);
    if (header.size() < std::uint64_t{header_size} + 4) return std::nullopt;
    const auto size =
        ByteCursor(ByteView(header).subspan(header_size), name()).take<std::uint32_t>();
    header.resize(header_size);
    const std::uint64_t data = offset + 4 + header_size + 4;
    return Record{chunk, offset, data, data + size, 0, std::move(header)};
  }

  template <typename T>
  T number(const Record& record, std::string_view field) const {
    const auto value = find_field(record.header, field, name());
    if (!value) throw InputError(name() + ": a record lacks \"" + std::string(field) + '"');
    return ByteCursor(*value, name()).take<T>();
  }

  std::string text(ByteView header, std::string_view field) const {
    const auto value = find_field(header, field, name());
    if (!value) throw InputError(name() + ": a record lacks \"" + std::string(field) + '"');
    return std::string(as_text(*value));
  }

  std::optional<Record> read_head(std::uint32_t chunk, std::uint64_t offset,
                                  std::uint64_t) override {
    auto record = record_at(chunk, offset);
    if (!record || !find_field(record->header, "op", name())) return std::nullopt;
    record->op = number<std::uint8_t>(*record, "op");
    return record;
  }

  std::optional<Chunk> chunk_of(const Record& record) override {
    if (record.op != kChunk) return std::nullopt;
    return Chunk{record.data, record.size(), number<std::uint32_t>(record, "size"),
                 text(record.header, "compression")};
  }

  void meet(const Record& record) override {
    if (record.op == kBagHeader) {
      const auto encryptor = find_field(record.header, "encryptor", name());
      if (encryptor && !encryptor->empty()) throw InputError(name() + ": is encrypted");
      index_at_ = number<std::uint64_t>(record, "index_pos");
    } else if (record.op == kIndex && record.is_in_file()) {
      add_index(
          {number<std::uint32_t>(record, "conn"), record.data, record.size() / kRos1IndexEntry});
    } else if (record.op == kConnection) {
      meet_connection(record);
    } else if (record.op == kMessage) {
      add_message_of(number<std::uint32_t>(record, "conn"), record);
    }
  }

  void meet_connection(const Record& record) {
    const auto id = number<std::uint32_t>(record, "conn");
    if (knows_channel(id)) return;
    const ByteVector header = file().read(record.chunk, record.data, record.size());
    add_channel(id,
                topic_of(text(record.header, "topic"), text(header, "type"), Serialization::kRos1));
  }

  std::uint64_t index_at_ = 0;  // where the index lies; 0 while a bag is being written
};

}  // namespace

std::unique_ptr<const Bag> open_ros1_bag(const std::filesystem::path& path) {
  return std::make_unique<const Ros1Bag>(path);
}

}  // namespace hybrid_slam
