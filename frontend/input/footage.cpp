#include "frontend/input/footage.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <opencv2/core.hpp>

#include "frontend/input/footage_cameras.h"
#include "frontend/input/footage_images.h"
#include "frontend/input/footage_times.h"
#include "frontend/input/stamp_pairing.h"
#include "frontend/input/video_sequence.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr double kNanosecond = 1e-9;  // [s]

struct Frames {
  std::vector<FramePaths> files;
  std::vector<std::int64_t> numbers;  // of the names, or places; empty if there are times
  std::vector<double> times;          // empty: the names do not tell
};

const char* order_name(NameOrder order) {
  switch (order) {
    case NameOrder::kStamps:
      return "times";
    case NameOrder::kNumbers:
      return "numbers";
    case NameOrder::kNames:
      break;
  }
  return "no one number that counts";
}

// The first of what was named, for messages.
std::string where(const std::vector<std::string>& source) { return source.front(); }

void check_same_order(const FootageList& left, const FootageList& other, const char* side) {
  if (left.order == other.order) return;
  throw InputError("the names of the left images tell " + std::string(order_name(left.order)) +
                   " (" + left.images.front().path.filename().string() + "), those of the " + side +
                   " ones " + order_name(other.order) + " (" +
                   other.images.front().path.filename().string() + ")");
}

StampedCamera stamped(const char* name, const FootageList& list) {
  StampedCamera camera{name, {}};
  for (const FootageImage& image : list.images) camera.files.push_back({image.key, image.path});
  return camera;
}

Frames pair_by_numbers(const FootageList& left, const FootageList& right, const std::string& source,
                       std::vector<std::string>& warnings) {
  std::map<std::int64_t, FramePaths> frames;
  for (const FootageImage& image : left.images) frames[image.key].left = image.path;
  for (const FootageImage& image : right.images) frames[image.key].right = image.path;
  Frames result;
  for (auto& [number, paths] : frames) {
    result.numbers.push_back(number);
    result.files.push_back(std::move(paths));
  }
  check_completeness(result.files, source, warnings);
  return result;
}

Frames pair_cameras(const Footage& footage, const FootageList& left, const FootageList& right,
                    const InputOptions& options, std::vector<std::string>& warnings) {
  check_same_order(left, right, "right");
  if (fs::equivalent(left.images.front().path, right.images.front().path)) {
    throw InputError(left.images.front().path.string() + ": is a left and a right image");
  }
  for (const FootageList* const list : {&left, &right}) {
    if (!list->note.empty()) warnings.push_back(list->note);
  }
  if (left.order == NameOrder::kStamps) {
    StampedFrames frames = pair_by_stamps(stamped("left", left), stamped("right", right),
                                          where(footage.left), options, warnings);
    return {std::move(frames.files), {}, std::move(frames.times)};
  }
  if (left.order == NameOrder::kNames && left.images.size() != right.images.size()) {
    throw InputError(where(footage.left) + ": " + std::to_string(left.images.size()) +
                     " images, but " + std::to_string(right.images.size()) + " in " +
                     where(footage.right) + ", and their names do not tell which belong together");
  }
  return pair_by_numbers(left, right, where(footage.left), warnings);
}

// Of images with times the nearest, if it is near; of others the same number.
void add_fisheye(const FootageList& list, const std::string& source, Frames& frames,
                 std::vector<std::string>& warnings) {
  if (list.order == NameOrder::kNames && list.images.size() != frames.files.size()) {
    throw InputError(source + ": " + std::to_string(list.images.size()) + " images for " +
                     std::to_string(frames.files.size()) +
                     " pairs, and their names do not tell which belong together");
  }
  if (list.order != NameOrder::kStamps) {
    std::map<std::int64_t, fs::path> by_number;
    for (const FootageImage& image : list.images) by_number[image.key] = image.path;
    for (std::size_t i = 0; i < frames.files.size(); ++i) {
      const auto found = by_number.find(frames.numbers[i]);
      if (found != by_number.end()) frames.files[i].fisheye = found->second;
    }
  } else {
    constexpr double kSynchronous = 0.01;  // [s]; more moves the wrist visibly
    std::size_t at = 0;
    for (std::size_t i = 0; i < frames.files.size(); ++i) {
      const auto distance = [&](std::size_t k) {
        return std::abs(static_cast<double>(list.images[k].key) * kNanosecond - frames.times[i]);
      };
      while (at + 1 < list.images.size() && distance(at + 1) <= distance(at)) ++at;
      if (distance(at) <= kSynchronous) frames.files[i].fisheye = list.images[at].path;
    }
  }
  const auto missing = std::count_if(frames.files.begin(), frames.files.end(),
                                     [](const FramePaths& f) { return f.fisheye.empty(); });
  if (missing == static_cast<std::ptrdiff_t>(frames.files.size())) {
    throw InputError(source + ": no fisheye image belongs to a stereo pair");
  }
  if (missing > 0) {
    warnings.push_back(source + ": " + std::to_string(missing) + " of " +
                       std::to_string(frames.files.size()) + " frames lack a fisheye image");
  }
}

void set_times(const Footage& footage, Frames& frames, std::vector<std::string>& warnings) {
  if (!footage.times.empty()) {
    std::vector<fs::path> left;
    for (const FramePaths& paths : frames.files) left.push_back(paths.left);
    if (frames.numbers.empty()) {
      for (std::size_t i = 0; i < left.size(); ++i) {
        frames.numbers.push_back(static_cast<std::int64_t>(i));
      }
    }
    frames.times = times_by_file(footage.times, left, frames.numbers, warnings);
  } else if (frames.times.empty()) {
    if (!(footage.rate > 0)) {
      throw InputError(where(footage.left) +
                       ": the names tell no times; give --times FILE, one per frame, or --fps HZ");
    }
    for (const std::int64_t number : frames.numbers) {
      frames.times.push_back(static_cast<double>(number - frames.numbers.front()) / footage.rate);
    }
  }
}

ImageSize first_fisheye_size(const std::vector<FramePaths>& files) {
  std::vector<FramePaths> fisheyes;
  for (const FramePaths& paths : files) fisheyes.push_back({paths.fisheye, {}, {}});
  return first_image_size(fisheyes);
}

bool is_video(const Footage& footage) { return is_video_name(where(footage.left)); }

std::unique_ptr<VideoFile> open_video(const std::vector<std::string>& source) {
  if (source.empty()) return nullptr;
  if (source.size() > 1 || !is_video_name(source.front())) {
    throw InputError(source.front() + ": must be one video, as the left one is");
  }
  return std::make_unique<VideoFile>(source.front());
}

// Frames that all cameras have; their times are the left one's.
std::vector<double> times_of_videos(const Footage& footage, const Videos& videos,
                                    std::vector<std::string>& warnings) {
  std::vector<double> times = videos.left->times();
  for (const VideoFile* const other : {videos.right.get(), videos.fisheye.get()}) {
    if (other == nullptr || other->times().size() == videos.left->times().size()) continue;
    warnings.push_back(where(footage.left) + ": has " +
                       std::to_string(videos.left->times().size()) + " frames, another camera's " +
                       std::to_string(other->times().size()) +
                       "; frames of one number are taken for pairs");
    times.resize(std::min(times.size(), other->times().size()));
  }
  Frames frames;
  for (std::size_t i = 0; i < times.size(); ++i) {
    frames.files.emplace_back();
    frames.numbers.push_back(static_cast<std::int64_t>(i));
  }
  if (footage.rate == 0) frames.times = std::move(times);
  set_times(footage, frames, warnings);
  for (std::size_t i = 1; i < frames.times.size(); ++i) {
    if (frames.times[i] > frames.times[i - 1]) continue;
    throw InputError(where(footage.left) + ": the times of frames " + std::to_string(i - 1) +
                     " and " + std::to_string(i) + " do not ascend; give --times or --fps");
  }
  return frames.times;
}

std::unique_ptr<ImageSequence> open_videos(const Footage& footage, FootageImages images,
                                           const InputOptions& options) {
  SequenceInfo info;
  info.layout = "footage";
  info.name = fs::path(where(footage.left)).stem().string();
  Videos videos{open_video(footage.left), open_video(footage.right), open_video(footage.fisheye)};
  info.times = times_of_videos(footage, videos, info.warnings);
  const FootageSizes sizes{videos.left->size(), videos.right->size(),
                           videos.fisheye ? videos.fisheye->size() : ImageSize()};
  auto rectifier = read_footage_cameras(footage, images, sizes, info);
  for (std::string& doubt : doubts_of_units(info)) info.warnings.push_back(std::move(doubt));
  return make_video_sequence(std::move(info), std::move(videos), options, std::move(rectifier));
}

ImageSize left_size(const Footage& footage) {
  if (is_video(footage)) return VideoFile(where(footage.left)).size();
  std::vector<FramePaths> files;
  for (const FootageImage& image : list_footage(footage.left).images) {
    files.push_back({image.path, {}, {}});
  }
  return first_image_size(files);
}

// File systems' own complaints become ours.
template <typename Action>
auto with_clear_errors(Action action) {
  cv::setNumThreads(1);  // OpenCV's setting is global; threads are the pipeline's to make
  try {
    return action();
  } catch (const fs::filesystem_error& error) {
    throw InputError(error.path1().string() + ": " + error.code().message());
  }
}

std::unique_ptr<ImageSequence> open_images(const Footage& footage, FootageImages images,
                                           const InputOptions& options) {
  SequenceInfo info;
  info.layout = "footage";
  const fs::path first = where(footage.left);
  info.name = folder_name(fs::is_directory(first) ? first : first.parent_path());
  const FootageList left = list_footage(footage.left);
  Frames frames = pair_cameras(footage, left, list_footage(footage.right), options, info.warnings);
  if (!footage.fisheye.empty()) {
    const FootageList fisheye = list_footage(footage.fisheye);
    check_same_order(left, fisheye, "fisheye's");
    add_fisheye(fisheye, where(footage.fisheye), frames, info.warnings);
  }
  set_times(footage, frames, info.warnings);
  FootageSizes sizes{first_image_size(frames.files), std::nullopt, {}};
  if (!footage.fisheye.empty()) sizes.fisheye = first_fisheye_size(frames.files);
  auto rectifier = read_footage_cameras(footage, images, sizes, info);
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files), options,
                                        std::move(rectifier));
}

}  // namespace

FootageMeanings footage_meanings(const Footage& footage) {
  return with_clear_errors([&] { return footage_meanings(footage, left_size(footage)); });
}

std::unique_ptr<ImageSequence> open_footage(const Footage& footage, FootageImages images,
                                            const InputOptions& options) {
  return with_clear_errors([&] {
    return is_video(footage) ? open_videos(footage, images, options)
                             : open_images(footage, images, options);
  });
}

}  // namespace hybrid_slam
