#pragma once

#include <cstddef>
#include <memory>

#include "apps/io/stage_times.h"
#include "apps/pipeline/slam_options.h"
#include "cameras/camera.h"
#include "frontend/input/image_sequence.h"
#include "frontend/tracking/frame.h"

namespace hybrid_slam {

// Turns one index into a frame ready to be tracked. Used by one thread at a time.
class FrameLoader {
 public:
  virtual ~FrameLoader() = default;

  // Throws InputError if what the frame is made of cannot be read: the frame counts as corrupt.
  virtual Frame load(std::size_t index, StageTimes& times) = 0;
};

// Where frames come from: images of a dataset, or a simulation of features. Const functions may be
// called from any thread.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual std::size_t size() const = 0;
  virtual const Calibrated<RectifiedStereo>& camera() const = 0;
  virtual std::unique_ptr<FrameLoader> make_loader() const = 0;  // one per thread
};

// Frames from images: decoding, SIFT in both, stereo matching. `sequence` must outlive it.
class ImageFrameSource final : public FrameSource {
 public:
  ImageFrameSource(const ImageSequence& sequence, const SlamOptions& options)
      : sequence_(sequence), options_(options) {}

  std::size_t size() const override { return sequence_.size(); }
  const Calibrated<RectifiedStereo>& camera() const override { return sequence_.info().stereo; }
  std::unique_ptr<FrameLoader> make_loader() const override;

 private:
  const ImageSequence& sequence_;
  SlamOptions options_;
};

}  // namespace hybrid_slam
