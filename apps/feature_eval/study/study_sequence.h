#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/feature_eval/study/tag_masks.h"
#include "cameras/camera.h"
#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

// A pair of images of one moment with the true motion between their cameras.
struct StudyPair {
  std::size_t frame = 0;  // of the sequence, from 0
  GrayImage left;
  GrayImage fisheye;
  Rigid3d left_from_fisheye;
  std::optional<GrayImage> left_mask;  // zero pixels must hold no keypoint
  std::optional<GrayImage> fisheye_mask;
};

// Every so many frames of a hybrid sequence with truth.
class StudySequence {
 public:
  // Throws InputError with one line if the dataset cannot be opened, or has no fisheye, or no true
  // poses of both cameras in any of the chosen frames.
  StudySequence(const std::string& dataset, int every, bool masks);

  const std::string& name() const { return images_->info().name; }
  const Camera& left_camera() const { return left_; }
  const Camera& fisheye_camera() const { return fisheye_; }
  const std::vector<std::size_t>& frames() const { return frames_; }  // that are chosen
  const std::vector<std::string>& warnings() const { return warnings_; }

  // Throws InputError if an image cannot be read.
  StudyPair read(std::size_t frame) const;

 private:
  void choose_frames(int every);
  void find_masks();
  std::optional<GrayImage> mask_of(std::size_t frame, bool fisheye) const;

  std::unique_ptr<ImageSequence> images_;
  Camera left_, fisheye_;
  std::vector<std::size_t> frames_;
  std::vector<std::string> warnings_;
  std::string mask_folder_;  // empty: there is none
  std::vector<Tag> tags_;
  std::unique_ptr<const PixelBearings> left_bearings_, fisheye_bearings_;  // where there are tags
};

}  // namespace hybrid_slam
