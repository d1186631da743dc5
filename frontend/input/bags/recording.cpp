#include "frontend/input/bags/recording.h"

#include <algorithm>
#include <filesystem>

#include "frontend/input/bags/bag_files.h"

namespace hybrid_slam {

namespace {

class Collector {
 public:
  Collector(const BagFiles& files, const CameraTopics& topics) : files_(files) {
    cameras_ = {{topics.left, &recorded_.left, &recorded_.left_info},
                {topics.right, &recorded_.right, &recorded_.right_info}};
    if (!topics.fisheye.empty()) {
      cameras_.push_back({topics.fisheye, &recorded_.fisheye, &recorded_.fisheye_info});
    }
  }

  Recorded collect(std::vector<std::string>& warnings) {
    for (std::uint32_t bag = 0; bag < files_.bags.size(); ++bag) {
      for (const BagMessage& message : files_.bags[bag]->messages()) {
        try {
          take(bag, message);
        } catch (const InputError& error) {
          if (unread_++ == 0) first_error_ = error.what();
        }
      }
    }
    if (unread_ > 0) {
      warnings.push_back(std::to_string(unread_) +
                         " messages cannot be read and are left out; first: " + first_error_);
    }
    for (const Camera& camera : cameras_) sort(camera, warnings);
    return std::move(recorded_);
  }

 private:
  struct Camera {
    std::string topic;
    std::vector<BagImage>* images;
    std::optional<CameraInfoMessage>* info;
  };

  void take(std::uint32_t bag, const BagMessage& message) {
    constexpr std::uint64_t kStart = 4 + kStampBytes;  // CDR's own four bytes come first
    const BagTopic& topic = files_.topic(bag, message);
    const Bag& file = *files_.bags[bag];
    for (const Camera& camera : cameras_) {
      if (topic.type != kCameraInfoType && topic.name == camera.topic) {
        const ByteVector start = file.read(message, kStart);
        const std::int64_t stamp = read_stamp({start, topic.serialization, file.name()});
        camera.images->push_back({stamp, bag, message});
      } else if (topic.type == kCameraInfoType && !*camera.info &&
                 topic.name == camera_info_topic(camera.topic)) {
        const ByteVector bytes = file.read(message);
        *camera.info = read_camera_info({bytes, topic.serialization, file.name()});
      }
    }
  }

  // By time; of images at one time the first stays.
  void sort(const Camera& camera, std::vector<std::string>& warnings) const {
    std::vector<BagImage>& images = *camera.images;
    const std::string where = files_.source + ": " + camera.topic;
    if (images.empty()) throw InputError(where + ": holds no images that can be read");
    std::stable_sort(images.begin(), images.end(),
                     [](const BagImage& a, const BagImage& b) { return a.stamp < b.stamp; });
    const std::size_t count = images.size();
    images.erase(
        std::unique(images.begin(), images.end(),
                    [](const BagImage& a, const BagImage& b) { return a.stamp == b.stamp; }),
        images.end());
    if (images.size() == 1 && count > 1) {
      throw InputError(where + ": the times in the headers are all the same (" +
                       std::to_string(images.front().stamp) + " ns)");
    }
    if (images.size() < count) {
      warnings.push_back(where + ": " + std::to_string(count - images.size()) +
                         " images have the time of another one and are left out");
    }
  }

  const BagFiles& files_;
  Recorded recorded_;
  std::vector<Camera> cameras_;
  std::size_t unread_ = 0;
  std::string first_error_;
};

}  // namespace

std::shared_ptr<const BagFiles> open_bag_files(const std::vector<std::string>& paths,
                                               std::vector<std::string>& warnings) {
  auto files = std::make_shared<BagFiles>();
  files->source = paths.front();
  for (const std::string& path : paths) {
    for (const std::filesystem::path& file : list_bag_files(path, warnings)) {
      files->bags.push_back(open_bag(file));
      const std::vector<std::string>& more = files->bags.back()->warnings();
      warnings.insert(warnings.end(), more.begin(), more.end());
    }
  }
  return files;
}

std::vector<BagTopic> all_topics(const BagFiles& files) {
  std::vector<BagTopic> topics;
  for (const auto& bag : files.bags) {
    for (const BagTopic& topic : bag->topics()) {
      const auto known = std::find_if(topics.begin(), topics.end(), [&](const BagTopic& other) {
        return other.name == topic.name && other.type == topic.type;
      });
      if (known == topics.end()) {
        topics.push_back(topic);
      } else {
        known->messages += topic.messages;
      }
    }
  }
  return topics;
}

Recorded collect(const BagFiles& files, const CameraTopics& topics,
                 std::vector<std::string>& warnings) {
  return Collector(files, topics).collect(warnings);
}

}  // namespace hybrid_slam
