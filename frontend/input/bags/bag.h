#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "frontend/input/bags/byte_cursor.h"

namespace hybrid_slam {

// How a message's fields became bytes.
enum class Serialization { kRos1, kCdr, kOther };

struct BagTopic {
  std::string name;
  std::string type;  // as ROS 1 writes it: "sensor_msgs/Image"
  Serialization serialization = Serialization::kOther;
  std::uint64_t messages = 0;  // as far as the file tells without being read as a whole
};

// Where a message lies; what the numbers mean is the format's.
struct BagMessage {
  std::uint32_t topic = 0;  // index into the bag's topics
  std::uint32_t chunk = 0;
  std::uint64_t offset = 0;
};

inline constexpr std::string_view kImageType = "sensor_msgs/Image";
inline constexpr std::string_view kCompressedImageType = "sensor_msgs/CompressedImage";
inline constexpr std::string_view kCameraInfoType = "sensor_msgs/CameraInfo";

// One file of recorded messages. What it holds is indexed when it is opened; messages are read when
// they are asked for. Safe to use from several threads.
class Bag {
 public:
  static constexpr std::uint64_t kWhole = std::numeric_limits<std::uint64_t>::max();

  virtual ~Bag() = default;
  const std::string& name() const { return name_; }  // the file's
  const std::vector<BagTopic>& topics() const { return topics_; }
  // Those of images and CameraInfo, in the file's order.
  const std::vector<BagMessage>& messages() const { return messages_; }
  const std::vector<std::string>& warnings() const { return warnings_; }  // one line each

  // The bytes of a message as it was published, or the first `most` of them or more. Throws
  // InputError if they are damaged.
  ByteVector read(const BagMessage& message, std::uint64_t most = kWhole) const;

 protected:
  explicit Bag(std::string name) : name_(std::move(name)) {}
  virtual ByteVector read_stored(const BagMessage& message, std::uint64_t most) const = 0;

  // The topic of this name and type ("pkg/Type" or "pkg/msg/Type"), made if it is new.
  std::uint32_t topic_of(std::string_view name, std::string_view type, Serialization serialization);
  bool is_wanted(std::uint32_t topic) const;
  void add_message(const BagMessage& message) { messages_.push_back(message); }
  void count_messages(std::uint32_t topic, std::uint64_t count) {
    topics_[topic].messages += count;
  }
  void warn(const std::string& what) { warnings_.push_back(name_ + ": " + what); }
  void warn_of(const InputError& error) { warnings_.push_back(error.what()); }

 private:
  std::string name_;
  std::vector<BagTopic> topics_;
  std::vector<BagMessage> messages_;
  std::vector<std::string> warnings_;
};

// ROS 1 bag 2.0 (chunks none, bz2, lz4), MCAP (none, lz4, zstd) or rosbag2's sqlite3 file, told by
// the content. A file that was cut off is read as far as it is whole, with a warning. Throws
// InputError with one line if it is none of them or its chunks cannot be decompressed.
std::unique_ptr<const Bag> open_bag(const std::filesystem::path& path);

// One per format; each for a file with its signature.
std::unique_ptr<const Bag> open_ros1_bag(const std::filesystem::path& path);
std::unique_ptr<const Bag> open_mcap(const std::filesystem::path& path);
std::unique_ptr<const Bag> open_sqlite_bag(const std::filesystem::path& path);

}  // namespace hybrid_slam
