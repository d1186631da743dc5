#include "apps/pipeline/frame_source.h"

#include <array>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "apps/pipeline/sift_pool.h"

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

// By an extractor of the pool. Adds what took time on a device, if there is one, under names that
// begin with `stage`: how long all extractors were in use by other threads, then the device's own
// time for each image.
std::vector<FeatureSet> extract(SiftPool& pool, std::span<const GrayImage* const> images,
                                const GrayImage* mask, const std::string& stage,
                                StageTimes& times) {
  StageClock waiting(times);
  const SiftPool::Lease sift = pool.take();
  if (pool.bounded()) waiting.lap(stage + "_wait");
  std::vector<FeatureSet> features = sift->extract(images, mask);
  for (const auto& [name, milliseconds] : sift->device_times()) {
    times.add(stage + "_device_" + name, milliseconds);
  }
  return features;
}

class ImageFrameLoader final : public FrameLoader {
 public:
  // `fisheye_sift`: null without a fisheye.
  ImageFrameLoader(const ImageSequence& sequence, const SlamOptions& options, SiftPool& sift,
                   SiftPool* fisheye_sift, const GrayImage& fisheye_mask)
      : sequence_(sequence),
        options_(options),
        sift_(sift),
        fisheye_sift_(fisheye_sift),
        fisheye_mask_(fisheye_mask) {}

  FrameSet load(std::size_t index, StageTimes& times) override {
    StageClock clock(times);
    FrameImages images = sequence_.read(index);
    clock.lap("read");
    FrameSet frames{load_stereo(images, clock, times), std::nullopt,
                    std::move(images.fisheye_error)};
    if (!images.fisheye.empty()) frames.fisheye = load_fisheye(images, clock, times);
    return frames;
  }

 private:
  Frame load_stereo(const FrameImages& images, StageClock& clock, StageTimes& times) {
    const std::array pair{&images.left, &images.right};
    std::vector<FeatureSet> found = extract(sift_, pair, nullptr, "sift", times);
    clock.lap("sift");
    auto left_pyramid = std::make_shared<const ImagePyramid>(images.left);
    const ImagePyramid right_pyramid(images.right);
    StereoFeatures features =
        match_stereo(std::move(found[0]), std::move(found[1]), left_pyramid.get(), &right_pyramid,
                     sequence_.info().stereo, options_.stereo);
    clock.lap("stereo_match");
    Frame frame = make_frame(images.frame_index, images.time, std::move(features),
                             images.left.width, images.left.height);
    frame.image = std::move(left_pyramid);
    return frame;
  }

  Frame load_fisheye(FrameImages& images, StageClock& clock, StageTimes& times) {
    GrayImage& image = images.fisheye;
    if (options_.fisheye.view.clahe > 0) enhance_contrast(image, options_.fisheye.view.clahe);
    const std::array<const GrayImage*, 1> single{&image};
    std::vector<FeatureSet> found =
        extract(*fisheye_sift_, single, &fisheye_mask_, "fisheye_sift", times);
    Frame frame = make_mono_frame(images.frame_index, images.time, std::move(found[0]), image.width,
                                  image.height);
    frame.image = std::make_shared<const ImagePyramid>(image);
    clock.lap("fisheye_sift");
    return frame;
  }

  const ImageSequence& sequence_;
  SlamOptions options_;
  SiftPool& sift_;
  SiftPool* fisheye_sift_;
  const GrayImage& fisheye_mask_;
};

}  // namespace

ImageFrameSource::ImageFrameSource(const ImageSequence& sequence, const SlamOptions& options,
                                   SiftDevice device)
    : sequence_(sequence),
      options_(options),
      sift_(std::make_unique<SiftPool>(device, options.sift, 2)) {
  if (sequence.info().fisheye) {
    fisheye_sift_ = std::make_unique<SiftPool>(device, fisheye_sift(options), 1);
    fisheye_mask_ =
        make_fisheye_mask(*sequence.info().fisheye, example_images(sequence), options.fisheye.view);
  }
}

ImageFrameSource::~ImageFrameSource() = default;

std::unique_ptr<FrameLoader> ImageFrameSource::make_loader() const {
  return std::make_unique<ImageFrameLoader>(sequence_, options_, *sift_, fisheye_sift_.get(),
                                            fisheye_mask_);
}

}  // namespace hybrid_slam
