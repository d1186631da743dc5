#include "apps/slam/frame_extractor.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "apps/slam/sift_pool.h"

namespace hybrid_slam {
namespace {

SiftOptions fisheye_sift(const SlamOptions& options) {
  SiftOptions sift = options.sift;
  sift.upsample = options.fisheye.upsample;
  return sift;
}

// By an extractor of the pool. Adds what took time on a device, if there is one, under names that
// begin with `stage`: how long all extractors were in use by other threads, then the device's own
// time for each image.
std::vector<FeatureSet> find_by(SiftPool& pool, std::span<const GrayImage* const> images,
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

// Non-zero where both are.
GrayImage both(const GrayImage& a, const GrayImage& b) {
  GrayImage mask = a;
  for (std::size_t i = 0; i < mask.pixels.size(); ++i) {
    if (b.pixels[i] == 0) mask.pixels[i] = 0;
  }
  return mask;
}

bool hardly_matches(const StereoFeatures& features) {
  const auto matches = std::count_if(features.right_of_left.begin(), features.right_of_left.end(),
                                     [](int right) { return right >= 0; });
  return 10 * matches < static_cast<std::ptrdiff_t>(features.left.size());
}

}  // namespace

FrameExtractor::FrameExtractor(const CameraRig& cameras, const SlamOptions& options,
                               SiftDevice device, const FirstImages& first)
    : cameras_(cameras),
      options_(options),
      upsampling_(choose_upsampling(cameras, first.stereo, options_)),
      sift_(std::make_unique<SiftPool>(device, options_.sift, 2)) {
  if (!cameras.fisheye) return;
  fisheye_sift_ = std::make_unique<SiftPool>(device, fisheye_sift(options_), 1);
  std::vector<GrayImage> examples;
  for (const auto& one : first.fisheye) examples.push_back(one->image);
  fisheye_mask_ = make_fisheye_mask(*cameras.fisheye, examples, options_.fisheye.view);
}

FrameExtractor::~FrameExtractor() = default;

std::vector<FeatureSet> FrameExtractor::find_features(const StereoImages& images,
                                                      StageTimes& times) {
  const std::array pair{&images.left, &images.right};
  if (images.mask.empty()) return find_by(*sift_, pair, nullptr, "sift", times);
  const std::span all(pair);
  std::vector<FeatureSet> found = find_by(*sift_, all.first(1), &images.mask, "sift", times);
  found.push_back(std::move(find_by(*sift_, all.last(1), nullptr, "sift", times).front()));
  return found;
}

CameraFrame FrameExtractor::extract(const StereoImages& images, bool check_pair,
                                    StageTimes& times) {
  StageClock clock(times);
  std::vector<FeatureSet> found = find_features(images, times);
  clock.lap("sift");
  auto left_pyramid = std::make_shared<const ImagePyramid>(images.left);
  const ImagePyramid right_pyramid(images.right);
  StereoFeatures features =
      match_stereo(std::move(found[0]), std::move(found[1]), left_pyramid.get(), &right_pyramid,
                   cameras_.stereo, options_.stereo);
  clock.lap("stereo_match");
  FrameEvidence evidence{{image_quality(images.left), image_quality(images.right)},
                         masked_share(images.mask),
                         std::nullopt,
                         0,
                         0};
  if (check_pair || hardly_matches(features)) {
    evidence.pair = hybrid_slam::check_pair(features.left, features.right);
  }
  clock.lap("diagnose");
  Frame frame = make_frame(0, to_seconds(images.time), std::move(features), images.left.width,
                           images.left.height);
  frame.image = std::move(left_pyramid);
  return {CameraKind::kStereo, images.time, std::move(frame), std::move(evidence)};
}

CameraFrame FrameExtractor::extract(const FisheyeImage& images, StageTimes& times) {
  StageClock clock(times);
  GrayImage image = images.image;
  if (options_.fisheye.view.clahe > 0) enhance_contrast(image, options_.fisheye.view.clahe);
  const GrayImage mask = images.mask.empty() ? GrayImage() : both(fisheye_mask_, images.mask);
  const std::array<const GrayImage*, 1> single{&image};
  std::vector<FeatureSet> found =
      find_by(*fisheye_sift_, single, mask.empty() ? &fisheye_mask_ : &mask, "fisheye_sift", times);
  Frame frame =
      make_mono_frame(0, to_seconds(images.time), std::move(found[0]), image.width, image.height);
  frame.image = std::make_shared<const ImagePyramid>(image);
  clock.lap("fisheye_sift");
  FrameEvidence evidence{{image_quality(images.image)}, masked_share(images.mask), {}, 0, 0};
  clock.lap("diagnose");
  return {CameraKind::kFisheye, images.time, std::move(frame), std::move(evidence)};
}

}  // namespace hybrid_slam
