#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontend/input/bags/messages.h"
#include "frontend/input/bags/topics.h"

namespace hybrid_slam {

// Where an image lies among the bags.
struct BagImage {
  std::int64_t stamp = 0;  // [ns]
  std::uint32_t bag = 0;
  BagMessage message;
};

// Bags that follow one another.
struct BagFiles {
  std::vector<std::unique_ptr<const Bag>> bags;
  std::string source;  // as messages call them

  const BagTopic& topic(std::uint32_t bag, const BagMessage& message) const {
    return bags[bag]->topics()[message.topic];
  }
};

// What the chosen topics hold.
struct Recorded {
  std::vector<BagImage> left, right, fisheye;  // by their times
  std::optional<CameraInfoMessage> left_info, right_info, fisheye_info;
};

// Opens them, with the files' own warnings. Throws InputError.
std::shared_ptr<const BagFiles> open_bag_files(const std::vector<std::string>& paths,
                                               std::vector<std::string>& warnings);

// The topics of all bags, each once.
std::vector<BagTopic> all_topics(const BagFiles& files);

// Reads the beginning of each image's message, in the files' order, and the first CameraInfo of
// each camera. Messages that cannot be read, and images that have the time of another one, are left
// out and counted in a warning. Throws InputError if a topic has no images, or all have one time.
Recorded collect(const BagFiles& files, const CameraTopics& topics,
                 std::vector<std::string>& warnings);

}  // namespace hybrid_slam
