#include "apps/slam/upsampling.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "frontend/features/sift.h"
#include "frontend/matching/image_pyramid.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {
namespace {

constexpr double kMaxSize = 2e-3;     // [rad], see the header
constexpr double kFullBudget = 0.95;  // of the features asked for: such an image has enough

// Scales over the focal length of the left features with a right match [rad].
void add_sizes(const StereoFeatures& features, double focal, std::vector<double>& sizes) {
  for (std::size_t i = 0; i < features.left.size(); ++i) {
    if (features.right_of_left[i] >= 0) {
      sizes.push_back(double{features.left.keypoints[i].scale} / focal);
    }
  }
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

UpsamplingEvidence look_at(std::span<const std::shared_ptr<const StereoImages>> pairs,
                           const Calibrated<RectifiedStereo>& camera, const SlamOptions& options) {
  if (pairs.empty()) return {"unreadable pairs", 0, 0};
  SiftOptions plain = options.sift;
  plain.upsample = false;
  const auto sift = make_sift(plain);
  UpsamplingEvidence evidence{"first pairs", options.features, 0};
  std::vector<double> sizes;
  for (const auto& images : pairs) {
    FeatureSet left = sift->extract(images->left, nullptr);
    FeatureSet right = sift->extract(images->right, nullptr);
    evidence.features = std::min(evidence.features, static_cast<int>(left.size()));
    add_sizes(
        match_stereo(std::move(left), std::move(right), nullptr, nullptr, camera, options.stereo),
        camera.params[0], sizes);
  }
  if (sizes.empty()) return {"no matches", evidence.features, 0};
  evidence.feature_size = median(sizes);
  return evidence;
}

bool suffices(const UpsamplingEvidence& evidence, int wanted) {
  return evidence.features >= kFullBudget * wanted && evidence.feature_size > 0 &&
         evidence.feature_size <= kMaxSize;
}

}  // namespace

UpsamplingEvidence choose_upsampling(const CameraRig& cameras,
                                     std::span<const std::shared_ptr<const StereoImages>> pairs,
                                     SlamOptions& options) {
  UpsamplingEvidence evidence{"option", 0, 0};
  if (options.upsampling == Upsampling::kAuto) {
    evidence = cameras.fisheye ? UpsamplingEvidence{"fisheye", 0, 0}
                               : look_at(pairs, cameras.stereo, options);
    options.upsampling = suffices(evidence, options.features) ? Upsampling::kOff : Upsampling::kOn;
  }
  options.distribute();
  return evidence;
}

}  // namespace hybrid_slam
