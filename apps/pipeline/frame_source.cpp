#include "apps/pipeline/frame_source.h"

#include <utility>
#include <vector>

namespace hybrid_slam {
namespace {

SiftOptions fisheye_sift(const SlamOptions& options) {
  SiftOptions sift = options.sift;
  sift.upsample = options.fisheye.upsample;
  return sift;
}

// Fisheye images from all over the sequence; those that cannot be read are left out.
std::vector<GrayImage> example_images(const ImageSequence& sequence) {
  constexpr std::size_t kExamples = 5;
  std::vector<GrayImage> images;
  for (std::size_t i = 0; i < kExamples && i < sequence.size(); ++i) {
    try {
      FrameImages frame = sequence.read(i * (sequence.size() - 1) / kExamples);
      if (!frame.fisheye.empty()) images.push_back(std::move(frame.fisheye));
    } catch (const InputError&) {
      continue;  // whoever reads the whole sequence will hear of it
    }
  }
  return images;
}

class ImageFrameLoader final : public FrameLoader {
 public:
  ImageFrameLoader(const ImageSequence& sequence, const SlamOptions& options, SiftDevice device,
                   const GrayImage& fisheye_mask)
      : sequence_(sequence),
        options_(options),
        fisheye_mask_(fisheye_mask),
        sift_(make_sift_on(device, options.sift)) {
    if (sequence.info().fisheye) fisheye_sift_ = make_sift_on(device, fisheye_sift(options));
  }

  FrameSet load(std::size_t index, StageTimes& times) override {
    StageClock clock(times);
    FrameImages images = sequence_.read(index);
    clock.lap("read");
    FrameSet frames{load_stereo(images, clock), std::nullopt, std::move(images.fisheye_error)};
    if (!images.fisheye.empty()) frames.fisheye = load_fisheye(images, clock);
    return frames;
  }

 private:
  Frame load_stereo(const FrameImages& images, StageClock& clock) {
    FeatureSet left = sift_->extract(images.left, nullptr);
    FeatureSet right = sift_->extract(images.right, nullptr);
    clock.lap("sift");
    auto left_pyramid = std::make_shared<const ImagePyramid>(images.left);
    const ImagePyramid right_pyramid(images.right);
    StereoFeatures features =
        match_stereo(std::move(left), std::move(right), left_pyramid.get(), &right_pyramid,
                     sequence_.info().stereo, options_.stereo);
    clock.lap("stereo_match");
    Frame frame = make_frame(images.frame_index, images.time, std::move(features),
                             images.left.width, images.left.height);
    frame.image = std::move(left_pyramid);
    return frame;
  }

  Frame load_fisheye(FrameImages& images, StageClock& clock) {
    GrayImage& image = images.fisheye;
    if (options_.fisheye.view.clahe > 0) enhance_contrast(image, options_.fisheye.view.clahe);
    FeatureSet features = fisheye_sift_->extract(image, &fisheye_mask_);
    Frame frame = make_mono_frame(images.frame_index, images.time, std::move(features), image.width,
                                  image.height);
    frame.image = std::make_shared<const ImagePyramid>(image);
    clock.lap("fisheye_sift");
    return frame;
  }

  const ImageSequence& sequence_;
  SlamOptions options_;
  const GrayImage& fisheye_mask_;
  std::unique_ptr<SiftExtractor> sift_;
  std::unique_ptr<SiftExtractor> fisheye_sift_;  // null without a fisheye
};

}  // namespace

ImageFrameSource::ImageFrameSource(const ImageSequence& sequence, const SlamOptions& options,
                                   SiftDevice device)
    : sequence_(sequence), options_(options), device_(device) {
  if (sequence.info().fisheye) {
    fisheye_mask_ =
        make_fisheye_mask(*sequence.info().fisheye, example_images(sequence), options.fisheye.view);
  }
}

std::unique_ptr<FrameLoader> ImageFrameSource::make_loader() const {
  return std::make_unique<ImageFrameLoader>(sequence_, options_, device_, fisheye_mask_);
}

}  // namespace hybrid_slam
