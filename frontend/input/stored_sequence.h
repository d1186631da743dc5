#pragma once

#include <memory>
#include <optional>

#include "frontend/input/image_decoders.h"
#include "frontend/input/image_sequence.h"
#include "frontend/input/rectification.h"

namespace hybrid_slam {

enum class SequenceCamera { kLeft, kRight, kFisheye };

// Where the images of a sequence lie: files of their own, or messages of a bag. Immutable; safe to
// use from several threads.
class ImageStore {
 public:
  virtual ~ImageStore() = default;
  virtual std::size_t size() const = 0;  // frames
  virtual bool has(std::size_t frame, SequenceCamera camera) const = 0;
  // Of an image that there is. Throws InputError if it cannot be read or, where a size is expected,
  // has another one.
  virtual DecodedImage decode(std::size_t frame, SequenceCamera camera,
                              std::optional<ImageSize> expected, GrayChannel channel) const = 0;
};

// A sequence whose images lie in a store. Rectifies what it reads if given a rectifier. What is
// white in images of more than 8 bits is found over the sequence unless `options` says it.
class StoredSequence : public ImageSequence {
 public:
  StoredSequence(SequenceInfo info, std::unique_ptr<const ImageStore> store,
                 const InputOptions& options, std::unique_ptr<const StereoRectifier> rectifier);
  const SequenceInfo& info() const override { return info_; }
  FrameImages read(std::size_t frame) const override;

  bool rectifies() const { return rectifier_ != nullptr; }

 private:
  void find_white();
  void warn_of_darkness();
  GrayImage read_image(std::size_t frame, SequenceCamera camera, ImageSize size) const;

  SequenceInfo info_;
  std::unique_ptr<const ImageStore> store_;
  InputOptions options_;
  std::unique_ptr<const StereoRectifier> rectifier_;  // null: the images are rectified
};

}  // namespace hybrid_slam
