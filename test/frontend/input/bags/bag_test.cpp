#include <sqlite3.h>

#include <catch2/catch.hpp>

#include "frontend/input/bags/bag.h"
#include "test/frontend/input/bags/bag_writer.h"
#include "test/frontend/input/dataset_writer.h"
#include "test/support/allocation_watch.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// Two topics of images, one of something else; bytes that tell each other apart.
std::vector<TestMessage> some_messages(bool ros1) {
  const std::string infix = ros1 ? "/" : "/msg/";
  std::vector<TestMessage> messages;
  for (int i = 0; i < 9; ++i) {
    ByteVector bytes(static_cast<std::size_t>(100 + 7 * i));
    for (std::size_t k = 0; k < bytes.size(); ++k) {
      bytes[k] = static_cast<std::uint8_t>(k < 2 ? k : 31 * i + 3 * static_cast<int>(k));
    }
    const char* const topic = i % 3 == 0 ? "/left" : i % 3 == 1 ? "/imu" : "/right";
    messages.push_back({topic, "sensor_msgs" + infix + (i % 3 == 1 ? "Imu" : "Image"), bytes});
  }
  return messages;
}

// What a bag gives back of the images, as topic and bytes.
std::vector<std::pair<std::string, ByteVector>> content(const Bag& bag) {
  std::vector<std::pair<std::string, ByteVector>> result;
  for (const BagMessage& message : bag.messages()) {
    result.emplace_back(bag.topics()[message.topic].name, bag.read(message));
    const ByteVector start = bag.read(message, 16);
    CHECK(start.size() >= 16);
    CHECK(std::equal(start.begin(), start.end(), result.back().second.begin()));
  }
  return result;
}

std::vector<std::pair<std::string, ByteVector>> images_of(
    const std::vector<TestMessage>& messages) {
  std::vector<std::pair<std::string, ByteVector>> result;
  for (const TestMessage& m : messages) {
    if (m.topic != "/imu") result.emplace_back(m.topic, m.bytes);
  }
  return result;
}

void write_bag(const fs::path& path, const std::string& format, const ChunkWriting& writing) {
  if (format == "ros1") write_ros1_bag(path, some_messages(true), writing);
  if (format == "mcap") write_mcap(path, some_messages(false), writing);
  if (format == "sqlite") write_sqlite_bag(path, some_messages(false));
}

struct Kind {
  const char* format;
  ChunkWriting writing;
};

const std::vector<Kind> kKinds{
    {"ros1", {"none", 2, true}},  {"ros1", {"bz2", 4, true}},   {"ros1", {"lz4", 4, true}},
    {"ros1", {"none", 4, false}}, {"ros1", {"lz4", 2, false}},  {"mcap", {"none", 2, true}},
    {"mcap", {"lz4", 4, true}},   {"mcap", {"zstd", 4, true}},  {"mcap", {"zstd", 2, false}},
    {"mcap", {"none", 3, false}}, {"mcap", {"none", 0, false}}, {"sqlite", {}}};

TEST_CASE("messages come back from every format, compression and kind of index") {
  const TempFolder folder;
  for (const Kind& kind : kKinds) {
    INFO(kind.format << " " << kind.writing.compression << " " << kind.writing.per_chunk << " "
                     << kind.writing.index);
    const fs::path path = folder.path() / "some.bag";
    fs::remove(path);
    write_bag(path, kind.format, kind.writing);
    const auto bag = open_bag(path);
    CHECK(content(*bag) == images_of(some_messages(true)));
    const bool was_closed = kind.format != std::string("ros1") || kind.writing.index;
    CHECK(bag->warnings().size() == (was_closed ? 0 : 1));
    REQUIRE(bag->topics().size() == 3);
    for (const BagTopic& topic : bag->topics()) {
      CHECK(topic.messages == 3);
      CHECK(topic.type == (topic.name == "/imu" ? "sensor_msgs/Imu" : "sensor_msgs/Image"));
    }
  }
}

TEST_CASE("of a bag that was cut off, what is whole is read, with a warning") {
  const TempFolder folder;
  for (const Kind& kind : kKinds) {
    if (std::string(kind.format) == "sqlite") continue;
    INFO(kind.format << " " << kind.writing.compression << " " << kind.writing.per_chunk);
    const fs::path path = folder.path() / "cut.bag";
    fs::remove(path);
    write_bag(path, kind.format, kind.writing);
    const auto whole = images_of(some_messages(true));
    std::size_t least = whole.size();
    for (auto size = fs::file_size(path) - 1; size >= 20; size -= 1 + size / 60) {
      fs::resize_file(path, size);
      const auto bag = open_bag(path);
      const auto read = content(*bag);
      CHECK(read.size() <= least);  // the shorter, the fewer
      CHECK(std::equal(read.begin(), read.end(), whole.begin()));
      CHECK(bag->warnings().size() == 1);
      least = read.size();
    }
    CHECK(least == 0);
  }
}

TEST_CASE("of a sqlite bag that was cut off, what can be read is read") {
  const TempFolder folder;
  const fs::path path = folder.path() / "cut.db3";
  std::vector<TestMessage> messages = some_messages(false);
  for (TestMessage& message : messages) message.bytes.resize(20000, 5);
  write_sqlite_bag(path, messages);
  fs::resize_file(path, fs::file_size(path) - 60000);
  const auto bag = open_bag(path);
  std::size_t good = 0, bad = 0;
  for (const BagMessage& message : bag->messages()) {
    const std::string line = complaint([&] { bag->read(message); });
    ++(line.empty() ? good : bad);
  }
  CHECK(good >= 3);
  CHECK(bad + bag->warnings().size() > 0);
}

TEST_CASE("what SQLite says of a damaged bag in two lines is one") {
  const TempFolder folder;
  const fs::path path = folder.path() / "a.db3";
  sqlite3* database = nullptr;
  REQUIRE(sqlite3_open(path.c_str(), &database) == SQLITE_OK);
  REQUIRE(sqlite3_exec(database,
                       "CREATE TABLE messages(id);"
                       "CREATE VIEW topics AS SELECT * FROM \"two\nlines\"",
                       nullptr, nullptr, nullptr) == SQLITE_OK);
  sqlite3_close(database);
  CHECK(complaint([&] { open_bag(path); }) ==
        path.string() + ": no bag of ROS 2: no such table: main.two?lines");
}

TEST_CASE("messages that were compressed by themselves are decompressed") {
  const TempFolder folder;
  std::vector<TestMessage> messages = some_messages(false);
  const auto expected = images_of(messages);
  for (TestMessage& message : messages) message.bytes = zstd_bytes(message.bytes);
  write_sqlite_bag(folder.path() / "a.db3", messages);
  CHECK(content(*open_bag(folder.path() / "a.db3")) == expected);
  write_mcap(folder.path() / "a.mcap", messages, {"none", 2, true});
  CHECK(content(*open_bag(folder.path() / "a.mcap")) == expected);
}

TEST_CASE("what is no bag, or cannot be decompressed, is refused in one line") {
  const TempFolder folder;
  const fs::path path = folder.path() / "x.bag";
  const auto refusal = [&] { return complaint([&] { open_bag(path); }); };
  CHECK(refusal() == path.string() + ": no such file");
  write_text(path, "");
  CHECK(refusal() == path.string() + ": an empty file");
  write_text(path, "some words that are no bag");
  CHECK(refusal() == path.string() + ": no bag: neither ROS 1, MCAP nor rosbag2's sqlite3");
  write_text(path, "#ROSBAG V1.2\nmore");
  CHECK(refusal().find("a bag of version 1.2, only 2.0") != std::string::npos);
  write_text(path, "\x28\xb5\x2f\xfd and more");
  CHECK(refusal().find("decompress it first (zstd -d)") != std::string::npos);
  write_text(path, std::string("SQLite format 3\0 and then something else", 40));
  CHECK(refusal().find(": no bag of ROS 2: ") != std::string::npos);
  write_mcap(path, some_messages(false), {"brotli", 2, true});
  CHECK(refusal() == path.string() +
                         ": a chunk is compressed by \"brotli\", which cannot be read (none, bz2, "
                         "lz4 and zstd can)");
  write_ros1_bag(path, some_messages(true), {"xz", 2, true});
  CHECK(refusal().find("compressed by \"xz\"") != std::string::npos);
}

TEST_CASE("a damaged chunk costs its own messages only") {
  const TempFolder folder;
  for (const Kind& kind : kKinds) {
    if (kind.writing.compression == "none") continue;
    INFO(kind.format << " " << kind.writing.compression << " " << kind.writing.index);
    const fs::path path = folder.path() / "x.bag";
    fs::remove(path);
    write_bag(path, kind.format, {kind.writing.compression, 3, kind.writing.index});
    std::string bytes = read_text(path);
    std::size_t from = kind.format == std::string("ros1") ? bytes.find("compression=") : 0;
    from = bytes.find(kind.writing.compression, from) + 60;  // in the first chunk
    for (std::size_t i = from; i < from + 40; ++i) bytes[i] = static_cast<char>(~bytes[i]);
    write_text(path, bytes);
    const auto bag = open_bag(path);
    const auto whole = images_of(some_messages(true));
    std::vector<std::pair<std::string, ByteVector>> read;
    for (const BagMessage& message : bag->messages()) {
      const std::string line = complaint(
          [&] { read.emplace_back(bag->topics()[message.topic].name, bag->read(message)); });
      CHECK((line.empty() || line.find("damaged") != std::string::npos));
    }
    // Without an index the first chunk tells of the channels, too, and what follows is unknown.
    if (kind.writing.index) CHECK(read == decltype(read)(whole.begin() + 2, whole.end()));
    if (!kind.writing.index) CHECK(!bag->warnings().empty());
  }
}

// Memory was made for what the damaged size said.
TEST_CASE("a chunk whose size is damaged is refused without memory for it") {
  const TempFolder folder;
  for (const char* const compression : {"bz2", "lz4", "zstd"}) {
    const fs::path path = folder.path() / compression;
    const bool is_ros1 = compression[0] == 'b';
    constexpr std::size_t kBefore = 16;  // [bytes] of MCAP's size before the compression's name
    if (is_ros1) {
      write_ros1_bag(path, some_messages(true), {compression, 9, true});
    } else {
      write_mcap(path, some_messages(false), {compression, 9, true});
    }
    std::string bytes = read_text(path);
    const std::size_t size = is_ros1 ? bytes.find("size=") + 5 : bytes.find(compression) - kBefore;
    REQUIRE(size < bytes.size());
    bytes.replace(size, 4, std::string("\0\0\0\x3f", 4));  // near 1 GiB, the most there may be
    write_text(path, bytes);
    const AllocationWatch watch;
    const auto bag = open_bag(path);
    REQUIRE(!bag->messages().empty());
    CHECK(complaint([&] { bag->read(bag->messages()[0]); }).ends_with("is damaged"));
    CHECK(watch.largest() < (std::size_t{16} << 20));
  }
}

TEST_CASE("names in a bag stand in one line") {
  const TempFolder folder;
  const fs::path path = folder.path() / "x.bag";
  write_mcap(path, {{"/le\nft", "sensor_msgs/msg/Image", ByteVector(100)}}, {"none", 1, true});
  CHECK(open_bag(path)->topics().at(0).name == "/le?ft");
  write_mcap(path, some_messages(false), {"bro\ntli", 2, true});
  CHECK(complaint([&] { open_bag(path); }).find("compressed by \"bro?tli\"") != std::string::npos);
}

}  // namespace
}  // namespace hybrid_slam
