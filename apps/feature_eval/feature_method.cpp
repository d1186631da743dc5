#include "apps/feature_eval/feature_method.h"

#include <utility>

#include "apps/feature_eval/opencv_sift.h"
#include "frontend/features/sift_device.h"

namespace hybrid_slam {
namespace {

constexpr double kAnyDistance = 2;  // unit descriptors are never farther apart

BruteForceOptions match_options() {
  return {.max_descriptor_distance = kAnyDistance, .ratio = kMatchRatio, .mutual = true};
}

// Features by an engine of SIFT, matched by the CPU.
class SiftMethod : public FeatureMethod {
 public:
  explicit SiftMethod(std::unique_ptr<SiftExtractor> sift) : sift_(std::move(sift)) {}

  FeatureSet extract(const GrayImage& image, StageTimes& times) override {
    StageClock clock(times);
    FeatureSet features = sift_->extract(image, nullptr);
    clock.lap(kTotal);
    auto stages = sift_->stage_times();
    if (stages.empty()) {
      sift_->time_stages(true);
      sift_->extract(image, nullptr);
      stages = sift_->stage_times();
      sift_->time_stages(false);
    }
    for (const auto& [stage, milliseconds] : stages) times.add(stage, milliseconds);
    return features;
  }

  std::vector<DescriptorMatch> match(const FeatureSet& query, const FeatureSet& train,
                                     StageTimes& times) override {
    StageClock whole(times), stage(times);
    auto matches = match_brute_force(query, train, match_options());
    stage.lap("match");
    whole.lap(kTotal);
    return matches;
  }

 private:
  std::unique_ptr<SiftExtractor> sift_;
};

}  // namespace

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

std::unique_ptr<FeatureMethod> make_sift_method(FeatureEngine engine, const SiftOptions& options) {
  if (engine == FeatureEngine::kOpenCv) {
    return std::make_unique<SiftMethod>(make_opencv_sift(options));
  }
  const auto device = engine == FeatureEngine::kCuda ? SiftDevice::kCuda : SiftDevice::kCpu;
  return std::make_unique<SiftMethod>(make_sift_on(device, options));
}

}  // namespace hybrid_slam
