#include "apps/feature_eval/opencv_sift.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "frontend/features/feature_selection.h"
#include "frontend/features/stage_stopwatch.h"

namespace hybrid_slam {
namespace {

// OpenCV (before 4.8's enable_precise_upscale) doubles the image with cv::resize, where output
// pixel x shows the input at x / 2 - 1/4, but reads a place in the doubled image as x / 2. Every
// place is thus 1/4 px too far right and down, whatever its octave: the octaves drop every other
// pixel of the doubled image and keep its origin.
constexpr float kUpsamplingOffset = 0.25F;

// Below this OpenCV has no octave to search.
constexpr int kMinImageSize = 12;

// OpenCV's setting is global: set once, before the first extractor of any thread is used.
void single_threaded_opencv() {
  [[maybe_unused]] static const bool kDone = (cv::setNumThreads(1), true);
}

int octave_of(const cv::KeyPoint& keypoint) {
  const int octave = keypoint.octave & 255;
  return octave < 128 ? octave : octave - 256;
}

// `sift` is a row of 128 non-negative numbers; only their ratios matter.
Descriptor to_root_sift(const float* sift) {
  float sum = 0;
  for (int i = 0; i < 128; ++i) sum += sift[i];
  const float scale = sum > 0 ? 1.0F / sum : 0.0F;
  Descriptor descriptor;
  for (std::size_t i = 0; i < 128; ++i) {
    const float root = std::round(512.0F * std::sqrt(sift[i] * scale));
    descriptor[i] = static_cast<std::uint8_t>(std::min(root, 255.0F));
  }
  return descriptor;
}

class OpenCvSift final : public SiftExtractor {
 public:
  explicit OpenCvSift(const SiftOptions& options)
      : options_(checked(options)),
        // OpenCV compares |difference of Gaussians| / 255 * layers with its threshold.
        sift_(cv::SIFT::create(0, options.octave_layers,
                               options.contrast_threshold * options.octave_layers / 255.0,
                               options.edge_threshold, options.initial_sigma)) {
    single_threaded_opencv();
  }

  FeatureSet extract(const GrayImage& image, const GrayImage* mask) override {
    check_sizes(image, mask);
    stages_.start();
    FeatureSet features;
    features.kind = DescriptorKind::kRootSiftOpenCv;
    if (std::min(image.width, image.height) < kMinImageSize) return features;

    const cv::Mat pixels(image.height, image.width, CV_8UC1,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    std::vector<cv::KeyPoint> found = detect(pixels, mask, &features.keypoints);
    const std::vector<int> selected =
        select_spread(features.keypoints, image.width, image.height, options_.max_features);
    keep(selected, &features.keypoints);
    keep(selected, &found);
    stages_.lap("detection");
    if (found.empty()) return features;
    cv::Mat descriptors;
    // Leaves keypoints and their order alone: none lies where OpenCV could not describe it.
    sift_->compute(pixels, found, descriptors);
    if (found.size() != selected.size()) throw std::logic_error("cv::SIFT dropped keypoints");

    features.descriptors.reserve(selected.size());
    for (int i = 0; i < descriptors.rows; ++i) {
      features.descriptors.push_back(to_root_sift(descriptors.ptr<float>(i)));
    }
    stages_.lap("descriptors");
    return features;
  }

  std::vector<std::pair<std::string, double>> stage_times() const override {
    return stages_.times();
  }

 private:
  template <typename T>
  static void keep(const std::vector<int>& selected, std::vector<T>* items) {
    std::vector<T> kept;
    kept.reserve(selected.size());
    for (const int i : selected) kept.push_back((*items)[static_cast<std::size_t>(i)]);
    *items = std::move(kept);
  }

  Keypoint convert(const cv::KeyPoint& found) const {
    Keypoint keypoint;
    keypoint.x = found.pt.x - kUpsamplingOffset;
    keypoint.y = found.pt.y - kUpsamplingOffset;
    keypoint.scale = found.size / 2;  // OpenCV's size is a diameter
    keypoint.angle = found.angle * static_cast<float>(std::numbers::pi / 180);
    if (keypoint.angle >= static_cast<float>(2 * std::numbers::pi)) keypoint.angle = 0;
    keypoint.response = found.response * 255;
    keypoint.sigma = options_.position_sigma(keypoint.scale);
    return keypoint;
  }

  // All keypoints, as OpenCV needs them for the description and, in the same order, as ours.
  std::vector<cv::KeyPoint> detect(const cv::Mat& pixels, const GrayImage* mask,
                                   std::vector<Keypoint>* keypoints) {
    std::vector<cv::KeyPoint> found;
    sift_->detect(pixels, found);
    std::erase_if(found, [&](const cv::KeyPoint& candidate) {
      if (!options_.upsample && octave_of(candidate) < 0) return true;
      if (!mask) return false;
      const Keypoint keypoint = convert(candidate);
      const int x = std::clamp(static_cast<int>(std::lround(keypoint.x)), 0, mask->width - 1);
      const int y = std::clamp(static_cast<int>(std::lround(keypoint.y)), 0, mask->height - 1);
      return mask->row(y)[x] == 0;
    });
    keypoints->reserve(found.size());
    for (const cv::KeyPoint& candidate : found) keypoints->push_back(convert(candidate));
    return found;
  }

  SiftOptions options_;
  cv::Ptr<cv::SIFT> sift_;
  StageStopwatch stages_;
};

}  // namespace

std::unique_ptr<SiftExtractor> make_opencv_sift(const SiftOptions& options) {
  return std::make_unique<OpenCvSift>(options);
}

}  // namespace hybrid_slam
