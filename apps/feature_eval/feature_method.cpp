#include "apps/feature_eval/feature_method.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/feature_eval/opencv_sift.h"
#include "frontend/features/sift_device.h"

namespace hybrid_slam {
namespace {

// RootSIFT's bytes are square roots of the histogram's shares: their squares are the histogram. In
// bytes again, of length 512.
Descriptor to_plain_sift(const Descriptor& root) {
  double squared_length = 0;
  for (const std::uint8_t byte : root) squared_length += std::pow(byte, 4);
  const double scale = squared_length > 0 ? 512 / std::sqrt(squared_length) : 0;
  Descriptor plain;
  std::transform(root.begin(), root.end(), plain.begin(), [&](std::uint8_t byte) {
    return static_cast<std::uint8_t>(std::min(std::round(scale * byte * byte), 255.0));
  });
  return plain;
}

// Features by an engine of SIFT, matched by the CPU.
class SiftMethod : public FeatureMethod {
 public:
  SiftMethod(std::unique_ptr<SiftExtractor> sift, SiftDescriptor kind)
      : FeatureMethod(kMatchRatio), sift_(std::move(sift)), kind_(kind) {}

  DescribedFeatures extract(const GrayImage& image, const GrayImage* mask,
                            StageTimes& times) override {
    StageClock clock(times);
    FeatureSet features = sift_->extract(image, mask);
    if (kind_ == SiftDescriptor::kPlain) {
      for (Descriptor& descriptor : features.descriptors) descriptor = to_plain_sift(descriptor);
    }
    clock.lap(kTotal);
    auto stages = sift_->stage_times();
    if (stages.empty()) {
      sift_->time_stages(true);
      sift_->extract(image, mask);
      stages = sift_->stage_times();
      sift_->time_stages(false);
    }
    for (const auto& [stage, milliseconds] : stages) times.add(stage, milliseconds);
    return {std::move(features.keypoints), std::move(features.descriptors)};
  }

 private:
  std::unique_ptr<SiftExtractor> sift_;
  SiftDescriptor kind_;
};

}  // namespace

std::vector<FeatureMatch> FeatureMethod::match(const DescribedFeatures& query,
                                               const DescribedFeatures& train, StageTimes& times) {
  StageClock whole(times), stage(times);
  auto matches = match_described(query, train, ratio_);
  stage.lap("match");
  whole.lap(kTotal);
  return matches;
}

std::string to_string(FeatureEngine engine) {
  switch (engine) {
    case FeatureEngine::kCpu:
      return "cpu";
    case FeatureEngine::kCuda:
      return "cuda";
    case FeatureEngine::kOpenCv:
      return "opencv";
  }
  return {};
}

std::string why_no_engine(FeatureEngine engine, const SiftOptions& options) {
  return engine == FeatureEngine::kCuda ? why_no_cuda_sift(options) : "";
}

std::unique_ptr<FeatureMethod> make_sift_method(FeatureEngine engine, const SiftOptions& options,
                                                SiftDescriptor kind) {
  if (engine == FeatureEngine::kOpenCv) {
    return std::make_unique<SiftMethod>(make_opencv_sift(options), kind);
  }
  const auto device = engine == FeatureEngine::kCuda ? SiftDevice::kCuda : SiftDevice::kCpu;
  return std::make_unique<SiftMethod>(make_sift_on(device, options), kind);
}

}  // namespace hybrid_slam
