#include "frontend/input/bags/bag_sequence.h"

#include <cstdio>
#include <filesystem>
#include <optional>

#include <opencv2/core.hpp>

#include "frontend/input/bags/camera_info.h"
#include "frontend/input/bags/raw_image.h"
#include "frontend/input/bags/recording.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/fisheye_calibration.h"
#include "frontend/input/footage_calibration.h"
#include "frontend/input/stamp_pairs.h"
#include "frontend/input/stored_sequence.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

double to_seconds(std::int64_t stamp) {
  return static_cast<double>(static_cast<long double>(stamp) / 1e9L);
}

struct FrameMessages {
  BagImage left, right;
  std::optional<BagImage> fisheye;
};

class BagStore final : public ImageStore {
 public:
  BagStore(std::shared_ptr<const BagFiles> files, std::vector<FrameMessages> frames)
      : files_(std::move(files)), frames_(std::move(frames)) {}
  std::size_t size() const override { return frames_.size(); }
  bool has(std::size_t frame, SequenceCamera camera) const override {
    return camera != SequenceCamera::kFisheye || frames_.at(frame).fisheye.has_value();
  }
  DecodedImage decode(std::size_t frame, SequenceCamera camera, std::optional<ImageSize> expected,
                      GrayChannel channel) const override {
    const FrameMessages& images = frames_.at(frame);
    return decode(camera == SequenceCamera::kLeft    ? images.left
                  : camera == SequenceCamera::kRight ? images.right
                                                     : images.fisheye.value(),
                  expected, channel);
  }

 private:
  DecodedImage decode(const BagImage& image, std::optional<ImageSize> expected,
                      GrayChannel channel) const {
    const Bag& bag = *files_->bags[image.bag];
    const BagTopic& topic = files_->topic(image.bag, image.message);
    char time[32];
    std::snprintf(time, sizeof(time), "%.9Lf", static_cast<long double>(image.stamp) / 1e9L);
    const std::string name = bag.name() + ": " + topic.name + " at " + time + " s";
    const ByteVector bytes = bag.read(image.message);
    const MessageBytes message{bytes, topic.serialization, name};
    return topic.type == kCompressedImageType
               ? decode_image(read_compressed_image(message), name, expected, channel)
               : decode_raw_image(read_image_message(message), name, expected, channel);
  }

  std::shared_ptr<const BagFiles> files_;
  std::vector<FrameMessages> frames_;
};

CameraStamps stamps_of(const std::string& topic, const std::vector<BagImage>& images) {
  CameraStamps stamps{topic, {}};
  for (const BagImage& image : images) stamps.stamps.push_back(image.stamp);
  return stamps;
}

std::vector<FrameMessages> make_frames(const Recorded& recorded, const CameraTopics& topics,
                                       const std::string& source, double tolerance,
                                       std::vector<std::string>& warnings) {
  std::vector<FrameMessages> frames;
  CameraStamps times{topics.left, {}};
  for (const auto& [left, right] :
       pair_stamps(stamps_of(topics.left, recorded.left), stamps_of(topics.right, recorded.right),
                   source, tolerance, warnings)) {
    frames.push_back({recorded.left[left], recorded.right[right], std::nullopt});
    times.stamps.push_back(recorded.left[left].stamp);
  }
  if (recorded.fisheye.empty()) return frames;
  for (const auto& [frame, fisheye] : pair_stamps(
           times, stamps_of(topics.fisheye, recorded.fisheye), source, tolerance, warnings)) {
    frames[frame].fisheye = recorded.fisheye[fisheye];
  }
  return frames;
}

const CameraInfoMessage& require_info(const std::optional<CameraInfoMessage>& info,
                                      const std::string& topic, const std::string& source) {
  if (info) return *info;
  throw InputError(source + ": no CameraInfo on " + camera_info_topic(topic) +
                   " (--calibration gives it from a file)");
}

// The size of the first image that can be read.
ImageSize image_size_of(const ImageStore& store, SequenceCamera camera) {
  std::string first_error;
  for (std::size_t frame = 0; frame < store.size(); ++frame) {
    if (!store.has(frame, camera)) continue;
    try {
      const DecodedImage image = store.decode(frame, camera, std::nullopt, GrayChannel::kGrey);
      return {image.gray.width, image.gray.height};
    } catch (const InputError& error) {
      if (first_error.empty()) first_error = error.what();
    }
  }
  throw InputError(first_error);
}

// By the CameraInfo messages. Images are rectified if their topics are named so, or nothing is left
// to be done.
PairCalibration recorded_pair(const Recorded& recorded, const CameraTopics& topics,
                              const std::string& source) {
  const CameraInfoMessage& left = require_info(recorded.left_info, topics.left, source);
  const CameraInfoMessage& right = require_info(recorded.right_info, topics.right, source);
  PairCalibration result;
  result.source = source + ": CameraInfo";
  const bool is_named = is_rectified_topic(topics.left) && is_rectified_topic(topics.right);
  if (is_named || (is_rectified(left) && is_rectified(right))) {
    result.rectified = rectified_pair(left, right, source);
  } else {
    result.raw = raw_pair(left, right, source);
  }
  return result;
}

PairCalibration pair_of_files(const std::vector<std::string>& files, ImageSize image) {
  PairCalibration pair = read_pair_calibration(files, false, image);
  if (files.size() > pair.files_used + 1) {
    throw InputError(files.back() + ": one calibration file too many");
  }
  return pair;
}

// By the file after the pair's.
Calibrated<KannalaBrandt> fisheye_of_file(const std::vector<std::string>& files,
                                          const PairCalibration& pair, ImageSize image,
                                          std::vector<std::string>& warnings) {
  if (files.size() == pair.files_used) {
    throw InputError(pair.source +
                     ": no calibration of the fisheye (--cameras stereo leaves it out)");
  }
  return read_fisheye_of_images(files.back(), image, warnings);
}

Calibrated<KannalaBrandt> recorded_fisheye(const Recorded& recorded, const CameraTopics& topics,
                                           const std::string& source, ImageSize image) {
  const CameraInfoMessage& info = require_info(recorded.fisheye_info, topics.fisheye, source);
  return fisheye_of_images(fisheye_camera(info, source), image, source + ": CameraInfo: fisheye");
}

std::string sequence_name(const std::string& path) {
  const std::string name = folder_name(path);
  return fs::is_directory(path) ? name : fs::path(name).stem().string();
}

std::unique_ptr<ImageSequence> open(const std::vector<std::string>& paths, SequenceCameras cameras,
                                    const BagOptions& bag_options, const InputOptions& options) {
  SequenceInfo info;
  info.name = sequence_name(paths.front());
  info.layout = "bag";
  const auto files = open_bag_files(paths, info.warnings);
  const std::string& source = files->source;
  const bool wants_fisheye = cameras != SequenceCameras::kStereo;
  const CameraTopics topics =
      choose_topics(all_topics(*files), bag_options.topics, wants_fisheye, source);
  if (topics.fisheye.empty() && cameras == SequenceCameras::kHybrid) {
    info.warnings.push_back(source + ": no topic of a fisheye");
  }
  const Recorded recorded = collect(*files, topics, info.warnings);
  auto frames = make_frames(recorded, topics, source, options.pair_tolerance, info.warnings);
  for (const FrameMessages& frame : frames) info.times.push_back(to_seconds(frame.left.stamp));
  auto store = std::make_unique<const BagStore>(files, std::move(frames));
  const std::vector<std::string>& calibration = bag_options.calibration;
  const ImageSize size = image_size_of(*store, SequenceCamera::kLeft);
  const PairCalibration pair = calibration.empty() ? recorded_pair(recorded, topics, source)
                                                   : pair_of_files(calibration, size);
  std::unique_ptr<const StereoRectifier> rectifier;
  if (pair.rectified) {
    take_rectified_pair(pair, info);
  } else {
    rectifier = take_raw_pair(pair, info);
  }
  check_image_size(size, {info.stereo.width, info.stereo.height}, pair.source);
  if (!topics.fisheye.empty()) {
    const ImageSize fisheye = image_size_of(*store, SequenceCamera::kFisheye);
    info.fisheye = calibration.empty() ? recorded_fisheye(recorded, topics, source, fisheye)
                                       : fisheye_of_file(calibration, pair, fisheye, info.warnings);
  }
  return std::make_unique<StoredSequence>(std::move(info), std::move(store), options,
                                          std::move(rectifier));
}

}  // namespace

std::unique_ptr<ImageSequence> open_bags(const std::vector<std::string>& paths,
                                         SequenceCameras cameras, const BagOptions& bag_options,
                                         const InputOptions& options) {
  cv::setNumThreads(1);  // OpenCV's setting is global; threads are the pipeline's to make
  if (paths.empty()) throw std::logic_error("open_bags: no path");
  try {
    return open(paths, cameras, bag_options, options);
  } catch (const fs::filesystem_error& error) {
    throw InputError(error.path1().string() + ": " + error.code().message());
  }
}

}  // namespace hybrid_slam
