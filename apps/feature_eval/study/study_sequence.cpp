#include "apps/feature_eval/study/study_sequence.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "cameras/files/input_error.h"
#include "frontend/input/file_sequence.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr double kSameTime = 1e-3;  // [s]: times in files may be rounded to milliseconds

std::optional<Rigid3d> pose_at(const std::vector<StampedPose>& poses, double time) {
  const auto at = std::lower_bound(poses.begin(), poses.end(), time - kSameTime,
                                   [](const StampedPose& p, double t) { return p.time < t; });
  if (at == poses.end() || at->time > time + kSameTime) return std::nullopt;
  return at->world_from_cam;
}

// Cameras whose centres coincide have no direction between them.
std::optional<Rigid3d> true_motion(const SequenceInfo& info, std::size_t frame) {
  constexpr double kLeast = 1e-6;  // [m]
  const auto left = pose_at(info.truth, info.times[frame]);
  const auto fisheye = pose_at(info.fisheye_truth, info.times[frame]);
  if (!left || !fisheye) return std::nullopt;
  const Rigid3d motion = inverse(*left) * *fisheye;
  return motion.translation().norm() > kLeast ? std::optional(motion) : std::nullopt;
}

// Empty where images do not lie in a folder of their own.
fs::path image_file(const ImageSequence& images, std::size_t frame, bool fisheye) {
  const auto* const files = dynamic_cast<const FileSequence*>(&images);
  if (files == nullptr) return {};
  return fisheye ? files->files(frame).fisheye : files->files(frame).left;
}

fs::path sequence_folder(const ImageSequence& images) {
  const fs::path folder = image_file(images, 0, false).parent_path();
  return folder.filename() == "raw" ? folder.parent_path().parent_path() : folder.parent_path();
}

}  // namespace

StudySequence::StudySequence(const std::string& dataset, int every, bool masks)
    : images_(open_sequence(dataset, SequenceLayout::kAuto, "", SequenceCameras::kHybrid)) {
  const SequenceInfo& info = images_->info();
  warnings_ = info.warnings;
  if (!info.fisheye) throw InputError(dataset + ": has no fisheye, which the study needs");
  if (!info.truth_has_rotation || info.fisheye_truth.empty()) {
    throw InputError(dataset + ": has no true poses of both cameras, which the study needs");
  }
  left_ = info.stereo;
  fisheye_ = *info.fisheye;
  choose_frames(every);
  if (frames_.empty()) {
    throw InputError(dataset + ": none of the chosen frames has true poses of both cameras");
  }
  if (masks) find_masks();
}

void StudySequence::choose_frames(int every) {
  std::size_t without = 0;
  for (std::size_t frame = 0; frame < images_->size(); frame += static_cast<std::size_t>(every)) {
    if (true_motion(images_->info(), frame)) {
      frames_.push_back(frame);
    } else {
      ++without;
    }
  }
  if (without > 0) {
    warnings_.push_back(name() + ": " + std::to_string(without) +
                        " of the chosen frames have no true poses and are left out");
  }
}

void StudySequence::find_masks() {
  const fs::path folder = sequence_folder(*images_);
  if (fs::is_directory(folder / "masks")) mask_folder_ = (folder / "masks").string();
  if (fs::exists(folder / "tags.txt")) tags_ = read_tags(folder / "tags.txt");
  if (!tags_.empty()) {
    left_bearings_ = std::make_unique<PixelBearings>(left_);
    fisheye_bearings_ = std::make_unique<PixelBearings>(fisheye_);
  }
  if (tags_.empty() && mask_folder_.empty()) {
    warnings_.push_back(folder.string() + ": has neither tags.txt nor masks: nothing is masked");
  }
}

std::optional<GrayImage> StudySequence::mask_of(std::size_t frame, bool fisheye) const {
  const Camera& camera = fisheye ? fisheye_ : left_;
  std::optional<GrayImage> mask;
  if (!mask_folder_.empty()) {
    const fs::path stem = image_file(*images_, frame, fisheye).stem();
    const fs::path file = fs::path(mask_folder_) / (stem.string() + ".png");
    if (!stem.empty() && fs::exists(file)) {
      mask = read_gray_image(file, {image_width(camera), image_height(camera)});
    }
  }
  if (tags_.empty()) return mask;
  const SequenceInfo& info = images_->info();
  const auto pose = pose_at(fisheye ? info.fisheye_truth : info.truth, info.times[frame]);
  return (fisheye ? fisheye_bearings_ : left_bearings_)
      ->without_tags(tags_, *pose, std::move(mask));
}

StudyPair StudySequence::read(std::size_t frame) const {
  FrameImages images = images_->read(frame);
  if (images.fisheye.empty()) {
    throw InputError(images.fisheye_error.empty() ? "no fisheye image" : images.fisheye_error);
  }
  return {frame,
          std::move(images.left),
          std::move(images.fisheye),
          *true_motion(images_->info(), frame),
          mask_of(frame, false),
          mask_of(frame, true)};
}

}  // namespace hybrid_slam
