#include "frontend/input/bags/bag.h"

#include <fstream>

#include "cameras/files/printable.h"
#include "frontend/input/bags/chunk_codec.h"

namespace hybrid_slam {

namespace {

// ROS 2 writes "sensor_msgs/msg/Image".
std::string plain_type(std::string_view type) {
  std::string plain(type);
  const std::size_t at = plain.find("/msg/");
  return at == std::string::npos ? plain : plain.replace(at, 5, "/");
}

std::string first_bytes(const std::filesystem::path& path) {
  std::string head(16, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return head;
}

}  // namespace

ByteVector Bag::read(const BagMessage& message, std::uint64_t most) const {
  ByteVector bytes = read_stored(message, std::max<std::uint64_t>(most, 4));
  if (topics_[message.topic].serialization != Serialization::kCdr || !is_zstd_frame(bytes)) {
    return bytes;
  }
  return decompress_zstd_frame(most == kWhole ? bytes : read_stored(message, kWhole), name_);
}

std::uint32_t Bag::topic_of(std::string_view name, std::string_view type,
                            Serialization serialization) {
  const std::string plain = printable(plain_type(type));
  const std::string shown = printable(name);  // ROS allows letters, digits, _ and / alone
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (topics_[i].name == shown && topics_[i].type == plain) return static_cast<std::uint32_t>(i);
  }
  topics_.push_back({shown, plain, serialization, 0});
  return static_cast<std::uint32_t>(topics_.size() - 1);
}

bool Bag::is_wanted(std::uint32_t topic) const {
  const BagTopic& t = topics_[topic];
  return t.serialization != Serialization::kOther &&
         (t.type == kImageType || t.type == kCompressedImageType || t.type == kCameraInfoType);
}

std::unique_ptr<const Bag> open_bag(const std::filesystem::path& path) {
  const std::string head = first_bytes(path);
  if (head.starts_with("#ROSBAG V2.0\n")) return open_ros1_bag(path);
  if (head.starts_with("\x89MCAP")) return open_mcap(path);
  if (head.starts_with("SQLite format 3")) return open_sqlite_bag(path);
  std::string reason = "no bag: neither ROS 1, MCAP nor rosbag2's sqlite3";
  if (head.starts_with("#ROSBAG V")) {
    reason = "a bag of version " + printable(head.substr(9, head.find('\n') - 9)) +
             ", only 2.0 can be read (rosbag fix converts it)";
  } else if (head.starts_with("\x28\xb5\x2f\xfd")) {
    reason = "compressed as a whole; decompress it first (zstd -d)";
  } else if (head.empty()) {
    reason = std::filesystem::exists(path) ? "an empty file" : "no such file";
  }
  throw InputError(path.string() + ": " + reason);
}

}  // namespace hybrid_slam
