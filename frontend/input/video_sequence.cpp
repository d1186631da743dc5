#include "frontend/input/video_sequence.h"

#include <utility>

namespace hybrid_slam {
namespace {

class VideoSequence final : public ImageSequence {
 public:
  VideoSequence(SequenceInfo info, Videos videos, const InputOptions& options,
                std::unique_ptr<const StereoRectifier> rectifier)
      : info_(std::move(info)),
        videos_(std::move(videos)),
        channel_(options.images.channel),
        rectifier_(std::move(rectifier)) {}

  const SequenceInfo& info() const override { return info_; }

  FrameImages read(std::size_t frame) const override {
    FrameImages images;
    images.frame_index = static_cast<std::int64_t>(frame);
    images.time = info_.times.at(frame);
    images.left = videos_.left->read(frame, channel_);
    images.right = videos_.right->read(frame, channel_);
    if (rectifier_) {
      rectifier_->rectify_left(images.left);
      rectifier_->rectify_right(images.right);
    }
    if (!videos_.fisheye) return images;
    try {
      images.fisheye = videos_.fisheye->read(frame, channel_);
    } catch (const InputError& error) {
      images.fisheye_error = error.what();
    }
    return images;
  }

 private:
  SequenceInfo info_;
  Videos videos_;
  GrayChannel channel_;
  std::unique_ptr<const StereoRectifier> rectifier_;
};

}  // namespace

std::unique_ptr<ImageSequence> make_video_sequence(
    SequenceInfo info, Videos videos, const InputOptions& options,
    std::unique_ptr<const StereoRectifier> rectifier) {
  return std::make_unique<VideoSequence>(std::move(info), std::move(videos), options,
                                         std::move(rectifier));
}

}  // namespace hybrid_slam
