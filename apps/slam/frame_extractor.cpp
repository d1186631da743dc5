#include "apps/slam/frame_extractor.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "apps/slam/sift_pool.h"
#include "cameras/files/input_error.h"
#include "frontend/input/image_file.h"
#include "frontend/input/image_noise.h"
#include "frontend/matching/pair_matches.h"

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

// Of the calibrated size; empty without a file.
GrayImage read_mask(const std::string& path, const Calibrated<RectifiedStereo>& camera) {
  if (path.empty()) return {};
  GrayImage mask = read_gray_image(path, {camera.width, camera.height});
  if (std::all_of(mask.pixels.begin(), mask.pixels.end(), [](auto pixel) { return pixel == 0; })) {
    throw InputError(path + ": the mask covers the whole image: zero is what is left out");
  }
  return mask;
}

// Non-zero where both are. An empty one covers nothing.
GrayImage both(const GrayImage& a, const GrayImage& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  GrayImage mask = a;
  for (std::size_t i = 0; i < mask.pixels.size(); ++i) {
    if (b.pixels[i] == 0) mask.pixels[i] = 0;
  }
  return mask;
}

// None where there is little noise.
std::optional<StereoImages> quietened(const StereoImages& images) {
  if (!is_noisy(images.left) && !is_noisy(images.right)) return std::nullopt;
  StereoImages quiet = images;
  suppress_noise(quiet.left);
  suppress_noise(quiet.right);
  return quiet;
}

// The matches of the first pairs, one pair after the other.
class FirstMatches {
 public:
  FirstMatches(const SlamOptions& options, const FirstImages& first) : first_(first) {
    SiftOptions plain = options.sift;
    plain.upsample = false;
    sift_ = make_sift(plain);
  }

  // With the next pair's; false if there is none.
  bool add_pair() {
    if (next_ == first_.stereo.size()) return false;
    const StereoImages& images = *first_.stereo[next_++];
    const std::vector<PairMatch> pair =
        match_pair(sift_->extract(images.left, nullptr), sift_->extract(images.right, nullptr));
    matches_.insert(matches_.end(), pair.begin(), pair.end());
    return true;
  }
  std::span<const PairMatch> all() const { return matches_; }

 private:
  const FirstImages& first_;
  std::unique_ptr<SiftExtractor> sift_;
  std::size_t next_ = 0;
  std::vector<PairMatch> matches_;
};

// How the right camera stands, by the first pairs. By the first alone where that shows nothing to
// be taken out, or nothing but what is known: then it costs one pair without upsampling.
SettledAlignment find_alignment(const Calibrated<RectifiedStereo>& camera,
                                const SlamOptions& options, const FirstImages& first,
                                const std::optional<PairAlignment>& known) {
  if (!options.align_pair) return {};
  FirstMatches matches(options, first);
  std::optional<PairAlignment> left_over;
  while (matches.add_pair()) {
    left_over = find_pair_alignment(
        camera, known ? aligned(camera, *known, matches.all())
                      : std::vector<PairMatch>(matches.all().begin(), matches.all().end()));
    if (left_over && !is_shown(*left_over)) break;
  }
  const bool shown = left_over && is_shown(*left_over);
  if (known && !shown) return {std::make_shared<const PairAlignment>(*known), false};
  const auto found = known && shown ? find_pair_alignment(camera, matches.all()) : left_over;
  if (!found || !is_shown(*found)) return {nullptr, known.has_value()};
  return {std::make_shared<const PairAlignment>(*found), known.has_value()};
}

bool hardly_matches(const StereoFeatures& features) {
  const auto matches = std::count_if(features.right_of_left.begin(), features.right_of_left.end(),
                                     [](int right) { return right >= 0; });
  return 10 * matches < static_cast<std::ptrdiff_t>(features.left.size());
}

}  // namespace

FrameExtractor::FrameExtractor(const CameraRig& cameras, const SlamOptions& options,
                               SiftDevice device, const FirstImages& first,
                               const std::optional<PairAlignment>& known)
    : cameras_(cameras),
      options_(options),
      upsampling_(choose_upsampling(cameras, first.stereo, options_)),
      alignment_(find_alignment(cameras.stereo, options_, first, known)),
      sift_(std::make_unique<SiftPool>(device, options_.sift, 2)),
      left_mask_(read_mask(options.masks.left, cameras.stereo)),
      right_mask_(read_mask(options.masks.right, cameras.stereo)) {
  if (alignment_.taken_out) aligner_.emplace(cameras.stereo, *alignment_.taken_out);
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
  const GrayImage left_mask = both(left_mask_, images.mask);
  const auto or_null = [](const GrayImage& mask) { return mask.empty() ? nullptr : &mask; };
  if (left_mask.empty() && right_mask_.empty()) {
    return find_by(*sift_, pair, nullptr, "sift", times);
  }
  const std::span all(pair);
  std::vector<FeatureSet> found = find_by(*sift_, all.first(1), or_null(left_mask), "sift", times);
  found.push_back(
      std::move(find_by(*sift_, all.last(1), or_null(right_mask_), "sift", times).front()));
  return found;
}

CameraFrame FrameExtractor::extract(const StereoImages& input, bool check_pair, StageTimes& times) {
  StageClock clock(times);
  std::optional<StereoImages> quiet = quietened(input);
  if (aligner_) {
    if (!quiet) quiet = input;
    aligner_->align(quiet->right);
  }
  const StereoImages& images = quiet ? *quiet : input;
  std::vector<FeatureSet> found = find_features(images, times);
  clock.lap("sift");
  auto left_pyramid = std::make_shared<const ImagePyramid>(images.left);
  const ImagePyramid right_pyramid(images.right);
  StereoFeatures features =
      match_stereo(std::move(found[0]), std::move(found[1]), left_pyramid.get(), &right_pyramid,
                   cameras_.stereo, options_.stereo);
  clock.lap("stereo_match");
  FrameEvidence evidence{{image_quality(input.left), image_quality(input.right)},
                         masked_share(images.mask),
                         std::nullopt,
                         0,
                         0,
                         alignment_.taken_out,
                         alignment_.changed};
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
  suppress_noise(image);
  if (options_.fisheye.view.clahe > 0) enhance_contrast(image, options_.fisheye.view.clahe);
  const GrayImage mask = both(fisheye_mask_, images.mask);
  const std::array<const GrayImage*, 1> single{&image};
  std::vector<FeatureSet> found = find_by(*fisheye_sift_, single, &mask, "fisheye_sift", times);
  Frame frame =
      make_mono_frame(0, to_seconds(images.time), std::move(found[0]), image.width, image.height);
  frame.image = std::make_shared<const ImagePyramid>(image);
  clock.lap("fisheye_sift");
  FrameEvidence evidence{{image_quality(images.image)}, masked_share(images.mask), {}, 0, 0};
  clock.lap("diagnose");
  return {CameraKind::kFisheye, images.time, std::move(frame), std::move(evidence)};
}

}  // namespace hybrid_slam
