#include "test/frontend/input/bags/bag_writer.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <sqlite3.h>
#include <zlib.h>
#include <zstd.h>

#include <fstream>
#include <map>
#include <stdexcept>
#include <utility>

namespace hybrid_slam {

namespace {

class Writer {
 public:
  explicit Writer(bool big_endian = false, bool aligned = false)
      : big_endian_(big_endian), aligned_(aligned) {}

  template <typename T>
  Writer& put(T value) {
    while (aligned_ && bytes.size() % sizeof(T) != 0) bytes.push_back(0);
    std::uint8_t raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));  // this machine is little endian
    if (big_endian_) std::reverse(std::begin(raw), std::end(raw));
    bytes.insert(bytes.end(), std::begin(raw), std::end(raw));
    return *this;
  }
  Writer& append(ByteView more) {
    bytes.insert(bytes.end(), more.begin(), more.end());
    return *this;
  }
  Writer& append(const std::string& text) {
    bytes.insert(bytes.end(), text.begin(), text.end());
    return *this;
  }
  Writer& block(ByteView more) { return put(static_cast<std::uint32_t>(more.size())).append(more); }
  Writer& block(const std::string& text) {
    return put(static_cast<std::uint32_t>(text.size())).append(text);
  }

  ByteVector bytes;

 private:
  bool big_endian_, aligned_;
};

// Fields of a message, its header first.
class MessageWriter {
 public:
  MessageWriter(const Wire& wire, std::int64_t stamp)
      : wire_(wire),
        is_cdr_(wire.serialization == Serialization::kCdr),
        fields(is_cdr_ && wire.big_endian, is_cdr_) {
    if (!is_cdr_) fields.put(std::uint32_t{7});
    fields.put(static_cast<std::uint32_t>(stamp / 1'000'000'000));
    fields.put(static_cast<std::uint32_t>(stamp % 1'000'000'000));
    text("cam");
  }
  void text(std::string value) {
    if (is_cdr_) value.push_back('\0');
    fields.block(value);
  }
  ByteVector finish() const {
    if (!is_cdr_) return fields.bytes;
    ByteVector whole{0, static_cast<std::uint8_t>(wire_.big_endian ? 0 : 1), 0, 0};
    whole.insert(whole.end(), fields.bytes.begin(), fields.bytes.end());
    return whole;
  }

 private:
  Wire wire_;
  bool is_cdr_;

 public:
  Writer fields;
};

ByteVector compress(const std::string& compression, const ByteVector& bytes) {
  if (compression == "zstd") return zstd_bytes(bytes);
  if (compression == "lz4") {
    ByteVector result(LZ4F_compressFrameBound(bytes.size(), nullptr));
    result.resize(
        LZ4F_compressFrame(result.data(), result.size(), bytes.data(), bytes.size(), nullptr));
    return result;
  }
  if (compression == "bz2") {
    ByteVector result(bytes.size() + bytes.size() / 100 + 600);
    auto size = static_cast<unsigned>(result.size());
    ByteVector copy = bytes;
    BZ2_bzBuffToBuffCompress(reinterpret_cast<char*>(result.data()), &size,
                             reinterpret_cast<char*>(copy.data()),
                             static_cast<unsigned>(copy.size()), 9, 0, 0);
    result.resize(size);
    return result;
  }
  return bytes;  // "none", or a name that nobody knows
}

void save(const std::filesystem::path& path, const ByteVector& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

// Numbers of the topics, from 0, in the order of their first messages.
std::map<std::string, std::uint32_t> number_topics(const std::vector<TestMessage>& messages) {
  std::map<std::string, std::uint32_t> ids;
  for (const TestMessage& m : messages)
    ids.emplace(m.topic, static_cast<std::uint32_t>(ids.size()));
  return ids;
}

struct Field {
  std::string name;
  ByteVector value;
};
template <typename T>
Field number_field(const std::string& name, T value) {
  return {name, Writer().put(value).bytes};
}
Field text_field(const std::string& name, const std::string& value) {
  return {name, {value.begin(), value.end()}};
}

ByteVector ros1_header(const std::vector<Field>& fields) {
  Writer header;
  for (const Field& field : fields) {
    header.put(static_cast<std::uint32_t>(field.name.size() + 1 + field.value.size()));
    header.append(field.name + '=').append(ByteView(field.value));
  }
  return header.bytes;
}

void put_ros1_record(Writer& out, const std::vector<Field>& fields, const ByteVector& data) {
  out.block(ByteView(ros1_header(fields))).block(ByteView(data));
}

void put_ros1_connection(Writer& out, std::uint32_t id, const TestMessage& message) {
  const ByteVector data =
      ros1_header({text_field("topic", message.topic), text_field("type", message.type),
                   text_field("md5sum", "*"), text_field("message_definition", "")});
  put_ros1_record(out,
                  {number_field("op", std::uint8_t{7}), number_field("conn", id),
                   text_field("topic", message.topic)},
                  data);
}

// What a bag begins with; where its index is, is 0 while it is being written.
ByteVector ros1_start(std::uint64_t index_position) {
  Writer out;
  out.append("#ROSBAG V2.0\n");
  put_ros1_record(
      out,
      {number_field("op", std::uint8_t{3}), number_field("index_pos", index_position),
       number_field("conn_count", std::uint32_t{1}), number_field("chunk_count", std::uint32_t{1})},
      ByteVector(3000, ' '));
  return out.bytes;
}

using Offsets = std::map<std::uint32_t, std::vector<std::uint64_t>>;  // by topic

void put_mcap_record(Writer& out, std::uint8_t op, const ByteVector& content) {
  out.put(op).put(std::uint64_t{content.size()}).append(ByteView(content));
}

void put_mcap_channel(Writer& out, std::uint32_t id, const TestMessage& message,
                      const std::string& encoding) {
  const auto number = static_cast<std::uint16_t>(id + 1);
  put_mcap_record(out, 3,
                  Writer().put(number).block(message.type).block("ros2msg").block("text").bytes);
  put_mcap_record(out, 4,
                  Writer()
                      .put(number)
                      .put(number)
                      .block(message.topic)
                      .block(encoding)
                      .put(std::uint32_t{0})
                      .bytes);
}

void put_mcap_message(Writer& out, std::uint32_t id, const TestMessage& message) {
  put_mcap_record(out, 5,
                  Writer()
                      .put(static_cast<std::uint16_t>(id + 1))
                      .put(std::uint32_t{0})
                      .put(std::uint64_t{99})
                      .put(std::uint64_t{99})
                      .append(ByteView(message.bytes))
                      .bytes);
}

}  // namespace

ByteVector zstd_bytes(const ByteVector& bytes) {
  ByteVector result(ZSTD_compressBound(bytes.size()));
  result.resize(ZSTD_compress(result.data(), result.size(), bytes.data(), bytes.size(), 3));
  return result;
}

ByteVector image_bytes(const Wire& wire, const TestImage& image) {
  MessageWriter writer(wire, image.stamp);
  writer.fields.put(image.height).put(image.width);
  writer.text(image.encoding);
  writer.fields.put(static_cast<std::uint8_t>(image.big_endian)).put(image.step);
  writer.fields.block(ByteView(image.data));
  return writer.finish();
}

ByteVector compressed_image_bytes(const Wire& wire, std::int64_t stamp, const ByteVector& file) {
  MessageWriter writer(wire, stamp);
  writer.text("mono8; png compressed ");
  writer.fields.block(ByteView(file));
  return writer.finish();
}

ByteVector camera_info_bytes(const Wire& wire, std::int64_t stamp, const CameraInfoMessage& info) {
  MessageWriter writer(wire, stamp);
  writer.fields.put(info.height).put(info.width);
  writer.text(info.distortion_model);
  writer.fields.put(static_cast<std::uint32_t>(info.d.size()));
  for (const double value : info.d) writer.fields.put(value);
  for (const double value : info.k) writer.fields.put(value);
  for (const double value : info.r) writer.fields.put(value);
  for (const double value : info.p) writer.fields.put(value);
  writer.fields.put(info.binning_x).put(info.binning_y);
  writer.fields.put(std::uint32_t{0})
      .put(std::uint32_t{0})
      .put(info.roi_height)
      .put(info.roi_width);
  writer.fields.put(std::uint8_t{0});
  return writer.finish();
}

void write_ros1_bag(const std::filesystem::path& path, const std::vector<TestMessage>& messages,
                    const ChunkWriting& writing) {
  const auto ids = number_topics(messages);
  Writer out;  // behind the first record
  std::map<std::string, bool> is_known;
  for (std::size_t begin = 0; begin < messages.size(); begin += writing.per_chunk) {
    Writer chunk;
    Offsets offsets;
    for (std::size_t i = begin; i < std::min(begin + writing.per_chunk, messages.size()); ++i) {
      const std::uint32_t id = ids.at(messages[i].topic);
      if (!std::exchange(is_known[messages[i].topic], true)) {
        put_ros1_connection(chunk, id, messages[i]);
      }
      offsets[id].push_back(chunk.bytes.size());
      put_ros1_record(chunk,
                      {number_field("op", std::uint8_t{2}), number_field("conn", id),
                       number_field("time", std::uint64_t{99})},
                      messages[i].bytes);
    }
    put_ros1_record(
        out,
        {number_field("op", std::uint8_t{5}), text_field("compression", writing.compression),
         number_field("size", static_cast<std::uint32_t>(chunk.bytes.size()))},
        compress(writing.compression, chunk.bytes));
    for (const auto& [id, list] : offsets) {
      if (!writing.index) break;
      Writer entries;
      for (const std::uint64_t offset : list) {
        entries.put(std::uint64_t{99}).put(static_cast<std::uint32_t>(offset));
      }
      put_ros1_record(out,
                      {number_field("op", std::uint8_t{4}), number_field("ver", std::uint32_t{1}),
                       number_field("conn", id),
                       number_field("count", static_cast<std::uint32_t>(list.size()))},
                      entries.bytes);
    }
  }
  const std::size_t index_at = out.bytes.size();
  for (const TestMessage& message : messages) {
    if (writing.index && std::exchange(is_known[message.topic], false)) {
      put_ros1_connection(out, ids.at(message.topic), message);
    }
  }
  const ByteVector start = ros1_start(0);
  ByteVector whole = ros1_start(writing.index ? start.size() + index_at : 0);
  whole.insert(whole.end(), out.bytes.begin(), out.bytes.end());
  save(path, whole);
}

void write_mcap(const std::filesystem::path& path, const std::vector<TestMessage>& messages,
                const ChunkWriting& writing, const std::string& encoding) {
  const auto ids = number_topics(messages);
  const std::string magic("\x89MCAP0\r\n", 8);
  Writer out;
  out.append(magic);
  put_mcap_record(out, 1, Writer().block("ros2").block("test").bytes);
  std::map<std::string, bool> is_known;
  const std::size_t step = writing.per_chunk == 0 ? messages.size() : writing.per_chunk;
  for (std::size_t begin = 0; begin < messages.size(); begin += step) {
    Writer chunk;
    Offsets offsets;
    for (std::size_t i = begin; i < std::min(begin + step, messages.size()); ++i) {
      const std::uint32_t id = ids.at(messages[i].topic);
      if (!std::exchange(is_known[messages[i].topic], true)) {
        put_mcap_channel(chunk, id, messages[i], encoding);
      }
      offsets[id].push_back(chunk.bytes.size());
      put_mcap_message(chunk, id, messages[i]);
    }
    if (writing.per_chunk == 0) {
      out.append(ByteView(chunk.bytes));
      continue;
    }
    const ByteVector stored = compress(writing.compression, chunk.bytes);
    const auto crc = static_cast<std::uint32_t>(crc32_z(0, chunk.bytes.data(), chunk.bytes.size()));
    Writer content;
    content.put(std::uint64_t{99}).put(std::uint64_t{99}).put(std::uint64_t{chunk.bytes.size()});
    content.put(crc).block(writing.compression == "none" ? "" : writing.compression);
    content.put(std::uint64_t{stored.size()}).append(ByteView(stored));
    put_mcap_record(out, 6, content.bytes);
    for (const auto& [id, list] : offsets) {
      if (!writing.index) break;
      Writer index;
      index.put(static_cast<std::uint16_t>(id + 1))
          .put(static_cast<std::uint32_t>(list.size() * 16));
      for (const std::uint64_t offset : list) index.put(std::uint64_t{99}).put(offset);
      put_mcap_record(out, 7, index.bytes);
    }
  }
  put_mcap_record(out, 15, Writer().put(std::uint32_t{0}).bytes);
  for (const TestMessage& message : messages) {
    if (writing.index && std::exchange(is_known[message.topic], false)) {
      put_mcap_channel(out, ids.at(message.topic), message, encoding);
    }
  }
  put_mcap_record(out, 2, ByteVector(20, 0));
  out.append(magic);
  save(path, out.bytes);
}

void write_sqlite_bag(const std::filesystem::path& path, const std::vector<TestMessage>& messages) {
  sqlite3* database = nullptr;
  const auto run = [&](const char* sql) {
    if (sqlite3_exec(database, sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
      throw std::runtime_error(sqlite3_errmsg(database));
    }
  };
  sqlite3_open(path.c_str(), &database);
  run("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
      " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)");
  run("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
      " timestamp INTEGER NOT NULL, data BLOB NOT NULL)");
  run("BEGIN");
  const auto ids = number_topics(messages);
  std::map<std::string, bool> is_known;
  for (const TestMessage& message : messages) {
    const std::string id = std::to_string(ids.at(message.topic) + 1);
    if (!std::exchange(is_known[message.topic], true)) {
      run(("INSERT INTO topics VALUES(" + id + ", '" + message.topic + "', '" + message.type +
           "', 'cdr', '')")
              .c_str());
    }
    sqlite3_stmt* row = nullptr;
    const std::string sql =
        "INSERT INTO messages(topic_id, timestamp, data) VALUES(" + id + ", 99, ?)";
    sqlite3_prepare_v2(database, sql.c_str(), -1, &row, nullptr);
    sqlite3_bind_blob(row, 1, message.bytes.data(), static_cast<int>(message.bytes.size()),
                      SQLITE_STATIC);
    if (sqlite3_step(row) != SQLITE_DONE) throw std::runtime_error(sqlite3_errmsg(database));
    sqlite3_finalize(row);
  }
  run("COMMIT");
  sqlite3_close(database);
}

}  // namespace hybrid_slam
