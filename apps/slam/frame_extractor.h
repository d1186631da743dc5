#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/io/stage_times.h"
#include "apps/slam/inputs.h"
#include "apps/slam/slam_options.h"
#include "apps/slam/upsampling.h"
#include "frontend/calibration/pair_alignment.h"
#include "frontend/features/sift_device.h"

namespace hybrid_slam {

class SiftPool;

// The first images of each camera, from which is settled how features are extracted.
struct FirstImages {
  std::vector<std::shared_ptr<const StereoImages>> stereo;
  std::vector<std::shared_ptr<const FisheyeImage>> fisheye;

  // How many are looked at, of each camera.
  static constexpr std::size_t kStereo = 3;
  static constexpr std::size_t kFisheye = 3;
};

// How right images are re-warped.
struct SettledAlignment {
  std::shared_ptr<const PairAlignment> taken_out;  // null: nothing is
  bool changed = false;                            // it is another one than the map says
};

// Makes frames of images: SIFT in all of them, stereo matching, contrast and mask of the fisheye.
// Several threads at a time.
class FrameExtractor {
 public:
  // Settles upsampling, what is taken out of right images and what the fisheye shows of the world
  // by the first images. `known`: how the right camera stood when the map was made, if anything was
  // taken out; it still is, unless the first images contradict. Throws InputError as
  // make_fisheye_mask() does, and for masks that cannot be used.
  FrameExtractor(const CameraRig& cameras, const SlamOptions& options, SiftDevice device,
                 const FirstImages& first, const std::optional<PairAlignment>& known = {});
  ~FrameExtractor();

  // `check_pair`: whether the images are a pair is looked at in any case; else only where hardly
  // anything matches.
  CameraFrame extract(const StereoImages& input, bool check_pair, StageTimes& times);
  CameraFrame extract(const FisheyeImage& image, StageTimes& times);

  const UpsamplingEvidence& upsampling() const { return upsampling_; }
  bool upsamples() const { return options_.sift.upsample; }

 private:
  std::vector<FeatureSet> find_features(const StereoImages& images, StageTimes& times);

  CameraRig cameras_;
  SlamOptions options_;
  UpsamplingEvidence upsampling_;
  SettledAlignment alignment_;           // taken out of right images
  std::optional<RightAligner> aligner_;  // likewise
  std::unique_ptr<SiftPool> sift_;
  std::unique_ptr<SiftPool> fisheye_sift_;  // null without a fisheye
  GrayImage left_mask_;                     // empty: all of the image shows the world
  GrayImage right_mask_;                    // likewise
  GrayImage fisheye_mask_;                  // empty without a fisheye
};

}  // namespace hybrid_slam
