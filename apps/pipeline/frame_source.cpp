#include "apps/pipeline/frame_source.h"

#include <utility>

namespace hybrid_slam {
namespace {

class ImageFrameLoader final : public FrameLoader {
 public:
  ImageFrameLoader(const ImageSequence& sequence, const SlamOptions& options)
      : sequence_(sequence), stereo_(options.stereo), sift_(make_sift(options.sift)) {}

  Frame load(std::size_t index, StageTimes& times) override {
    StageClock clock(times);
    const StereoImages images = sequence_.read(index);
    clock.lap("read");
    FeatureSet left = sift_->extract(images.left, nullptr);
    FeatureSet right = sift_->extract(images.right, nullptr);
    clock.lap("sift");
    auto left_pyramid = std::make_shared<const ImagePyramid>(images.left);
    const ImagePyramid right_pyramid(images.right);
    StereoFeatures features = match_stereo(std::move(left), std::move(right), left_pyramid.get(),
                                           &right_pyramid, sequence_.info().stereo, stereo_);
    clock.lap("stereo_match");
    Frame frame = make_frame(images.frame_index, images.time, std::move(features),
                             images.left.width, images.left.height);
    frame.left = std::move(left_pyramid);
    return frame;
  }

 private:
  const ImageSequence& sequence_;
  StereoMatcherOptions stereo_;
  std::unique_ptr<SiftExtractor> sift_;
};

}  // namespace

std::unique_ptr<FrameLoader> ImageFrameSource::make_loader() const {
  return std::make_unique<ImageFrameLoader>(sequence_, options_);
}

}  // namespace hybrid_slam
