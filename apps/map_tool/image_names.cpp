#include "apps/map_tool/image_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "apps/io/picture_file.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr double kSameTime = 1e-6;  // [s]: as exact as seconds of an epoch can be in a double

std::optional<std::size_t> frame_at(const std::vector<double>& times, double time) {
  const auto at = std::lower_bound(times.begin(), times.end(), time - kSameTime);
  if (at == times.end() || *at > time + kSameTime) return std::nullopt;
  return static_cast<std::size_t>(at - times.begin());
}

// "left", or "left2" of the second camera of its kind.
std::string folder_of(const MapSnapshot& map, const Keyframe& keyframe, ImageSide side) {
  const CameraId camera = keyframe.observations->camera;
  const bool stereo = baseline(map.camera(camera)) > 0;
  int number = 1;
  for (std::uint32_t i = 0; i < camera.value; ++i) {
    number += (baseline(map.camera(CameraId(i))) > 0) == stereo ? 1 : 0;
  }
  const char* const kind = !stereo ? "fisheye" : side == ImageSide::kRight ? "right" : "left";
  return number == 1 ? kind : fmt::format("{}{}", kind, number);
}

void write_gray(const fs::path& path, const GrayImage& image) {
  cv::Mat gray(image.height, image.width, CV_8UC1);
  std::copy(image.pixels.begin(), image.pixels.end(), gray.begin<std::uint8_t>());
  cv::Mat picture;
  cv::merge(std::vector<cv::Mat>(3, gray), picture);
  make_folder(path.parent_path());
  write_picture(path, picture);
}

}  // namespace

std::int64_t nanoseconds_of(const Keyframe& keyframe) {
  return std::llround(keyframe.observations->time * 1e9);
}

std::map<KeyframeId, std::size_t> runs_of(const MapSnapshot& map) {
  std::map<KeyframeId, std::size_t> runs;
  std::map<CameraId, double> newest;
  std::size_t run = 0;
  for (const KeyframeId id : map.keyframe_ids()) {
    const FrameObservations& frame = *map.at(id).observations;
    const auto [last, first] = newest.try_emplace(frame.camera, frame.time);
    if (!first && frame.time <= last->second) {
      ++run;
      newest.clear();
    }
    newest[frame.camera] = frame.time;
    runs.emplace(id, run);
  }
  return runs;
}

ImageNames::ImageNames(const MapSnapshot& map, const std::vector<std::string>& datasets)
    : map_(map), runs_(runs_of(map)) {
  for (const std::string& folder : datasets) {
    datasets_.push_back(
        {folder, open_sequence(folder, SequenceLayout::kAuto, "", SequenceCameras::kAuto)});
  }
  for (const KeyframeId id : map.keyframe_ids()) {
    const Dataset* const dataset = dataset_of(map.at(id));
    if (dataset == nullptr) continue;
    const double time = map.at(id).observations->time;
    const auto frame = frame_at(dataset->images->info().times, time);
    if (!frame) {
      throw InputError(fmt::format("{}: no image of time {:.9f} s, of keyframe {}",
                                   dataset->folder.string(), time, id.value));
    }
    frames_.emplace(id, *frame);
  }
}

const ImageNames::Dataset* ImageNames::dataset_of(const Keyframe& keyframe) const {
  const std::size_t run = runs_.at(keyframe.id);
  return run < datasets_.size() ? &datasets_[run] : nullptr;
}

fs::path ImageNames::path_of(const Keyframe& keyframe, ImageSide side) const {
  const Dataset* const dataset = dataset_of(keyframe);
  if (dataset == nullptr) return {};
  const FramePaths& paths = dataset->files().files(frames_.at(keyframe.id));
  return side == ImageSide::kLeft    ? paths.left
         : side == ImageSide::kRight ? paths.right
                                     : paths.fisheye;
}

bool ImageNames::is_rectified(const Keyframe& keyframe, ImageSide side) const {
  const Dataset* const dataset = dataset_of(keyframe);
  return dataset != nullptr && side != ImageSide::kSingle && dataset->files().rectifies();
}

std::optional<fs::path> ImageNames::file(const Keyframe& keyframe, ImageSide side) const {
  const fs::path path = path_of(keyframe, side);
  return path.empty() || is_rectified(keyframe, side) ? std::nullopt : std::optional(path);
}

std::string ImageNames::name(const Keyframe& keyframe, ImageSide side) const {
  const fs::path path = path_of(keyframe, side);
  if (path.empty()) {
    const std::size_t run = runs_.at(keyframe.id);
    return fmt::format("{}{}/{:019}.png", run > 0 ? fmt::format("run{}/", run + 1) : "",
                       folder_of(map_, keyframe, side), nanoseconds_of(keyframe));
  }
  fs::path name = path.lexically_relative(dataset_of(keyframe)->folder);
  if (name.empty() || *name.begin() == "..") name = path.filename();
  if (is_rectified(keyframe, side)) name.replace_extension(".png");
  return name.generic_string();
}

std::size_t ImageNames::write_rectified(const fs::path& folder) const {
  std::size_t written = 0;
  for (const KeyframeId id : map_.keyframe_ids()) {
    const Keyframe& keyframe = map_.at(id);
    const bool stereo = baseline(map_.camera(keyframe)) > 0;
    if (!stereo || !is_rectified(keyframe, ImageSide::kLeft)) continue;
    const FrameImages images = dataset_of(keyframe)->images->read(frames_.at(id));
    write_gray(folder / name(keyframe, ImageSide::kLeft), images.left);
    write_gray(folder / name(keyframe, ImageSide::kRight), images.right);
    written += 2;
  }
  return written;
}

}  // namespace hybrid_slam
