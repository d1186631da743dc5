#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/io/stage_times.h"
#include "apps/pipeline/slam_options.h"
#include "cameras/camera.h"
#include "frontend/features/sift_device.h"
#include "frontend/input/image_sequence.h"
#include "frontend/tracking/frame.h"

namespace hybrid_slam {

// What all cameras saw at one moment, ready to be tracked.
struct FrameSet {
  Frame stereo;
  std::optional<Frame> fisheye;  // none without such a camera, or if its image cannot be read
  std::string fisheye_error;     // why it cannot
};

class SiftPool;

// Turns one index into frames ready to be tracked. Used by one thread at a time.
class FrameLoader {
 public:
  virtual ~FrameLoader() = default;

  // Throws InputError if what the stereo frame is made of cannot be read: it counts as corrupt.
  virtual FrameSet load(std::size_t index, StageTimes& times) = 0;
};

// Where frames come from: images of a dataset, or a simulation of features. Const functions may be
// called from any thread.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual std::size_t size() const = 0;
  virtual const Calibrated<RectifiedStereo>& camera() const = 0;
  virtual const Calibrated<KannalaBrandt>* fisheye() const { return nullptr; }  // null: none
  virtual std::unique_ptr<FrameLoader> make_loader() const = 0;                 // one per thread
};

// Frames from images: decoding, SIFT in all of them, stereo matching. `sequence` must outlive it.
class ImageFrameSource final : public FrameSource {
 public:
  // Looks at a few fisheye images, if there is such a camera, for what they show of the world.
  // Throws InputError as make_fisheye_mask() does.
  ImageFrameSource(const ImageSequence& sequence, const SlamOptions& options,
                   SiftDevice device = SiftDevice::kCpu);
  ~ImageFrameSource() override;

  std::size_t size() const override { return sequence_.size(); }
  const Calibrated<RectifiedStereo>& camera() const override { return sequence_.info().stereo; }
  const Calibrated<KannalaBrandt>* fisheye() const override {
    const auto& fisheye = sequence_.info().fisheye;
    return fisheye ? &*fisheye : nullptr;
  }
  std::unique_ptr<FrameLoader> make_loader() const override;

 private:
  const ImageSequence& sequence_;
  SlamOptions options_;
  std::unique_ptr<SiftPool> sift_;          // of all loaders
  std::unique_ptr<SiftPool> fisheye_sift_;  // null without a fisheye
  GrayImage fisheye_mask_;                  // empty without a fisheye
};

}  // namespace hybrid_slam
