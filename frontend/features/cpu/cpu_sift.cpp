#include "frontend/features/cpu/cpu_sift.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "frontend/features/cpu/patch_kernels.h"
#include "frontend/features/feature_selection.h"

namespace hybrid_slam {
namespace {

sift::PlaceInLevel place_in_level(const sift::Extremum& extremum) {
  return {extremum.level_x, extremum.level_y, extremum.level_scale};
}

bool masked(const GrayImage& mask, const sift::Extremum& extremum) {
  const int x = std::clamp(static_cast<int>(std::lround(extremum.x)), 0, mask.width - 1);
  const int y = std::clamp(static_cast<int>(std::lround(extremum.y)), 0, mask.height - 1);
  return mask.row(y)[x] == 0;
}

}  // namespace

CpuSift::CpuSift(const SiftOptions& options) : options_(checked(options)), scale_space_(options_) {}

FeatureSet CpuSift::extract(const GrayImage& image, const GrayImage* mask) {
  stages_.start();
  detect(image, mask);
  stages_.lap("scale space and extrema");
  const std::vector<sift::Extremum> selected = select();
  stages_.lap("selection");
  Oriented oriented = orient(selected);
  stages_.lap("orientation");
  FeatureSet features;
  features.kind = DescriptorKind::kRootSift;
  features.descriptors = describe(oriented);
  stages_.lap("descriptors");
  features.keypoints = std::move(oriented.keypoints);
  return features;
}

const std::vector<sift::Extremum>& CpuSift::detect(const GrayImage& image, const GrayImage* mask) {
  check_sizes(image, mask);
  width_ = image.width;
  height_ = image.height;
  extrema_ = scale_space_.detect(image);
  if (mask) std::erase_if(extrema_, [&](const auto& e) { return masked(*mask, e); });
  return extrema_;
}

Keypoint CpuSift::keypoint_of(const sift::Extremum& extremum) const {
  Keypoint keypoint;
  keypoint.x = extremum.x;
  keypoint.y = extremum.y;
  keypoint.scale = extremum.scale;
  keypoint.response = extremum.response;
  keypoint.sigma = options_.position_sigma(extremum.scale);
  return keypoint;
}

std::vector<sift::Extremum> CpuSift::select() const {
  std::vector<Keypoint> keypoints;
  keypoints.reserve(extrema_.size());
  for (const sift::Extremum& extremum : extrema_) keypoints.push_back(keypoint_of(extremum));
  std::vector<int> kept = select_spread(keypoints, width_, height_, options_.max_features);
  std::sort(kept.begin(), kept.end());
  std::vector<sift::Extremum> selected;
  selected.reserve(kept.size());
  for (const int i : kept) selected.push_back(extrema_[static_cast<std::size_t>(i)]);
  return selected;
}

CpuSift::Oriented CpuSift::orient(const std::vector<sift::Extremum>& extrema) const {
  std::vector<Keypoint> keypoints;
  std::vector<std::size_t> extremum_of;
  for (std::size_t i = 0; i < extrema.size(); ++i) {
    if (i + 1 < extrema.size()) prefetch(extrema[i + 1], sift::kOrientationReach);
    float angles[sift::kMaxOrientations];
    const int count = sift::find_angles(level_of(extrema[i]), place_in_level(extrema[i]), angles);
    for (int k = 0; k < count; ++k) {
      keypoints.push_back(keypoint_of(extrema[i]));
      keypoints.back().angle = angles[k];
      extremum_of.push_back(i);
    }
  }
  const std::vector<int> kept = select_spread(keypoints, width_, height_, options_.max_features);
  Oriented oriented;
  for (const int i : kept) {
    const auto index = static_cast<std::size_t>(i);
    oriented.keypoints.push_back(keypoints[index]);
    oriented.extrema.push_back(extrema[extremum_of[index]]);
  }
  oriented.by_place.resize(kept.size());
  std::iota(oriented.by_place.begin(), oriented.by_place.end(), 0);
  std::sort(oriented.by_place.begin(), oriented.by_place.end(), [&](int a, int b) {
    return kept[static_cast<std::size_t>(a)] < kept[static_cast<std::size_t>(b)];
  });
  return oriented;
}

std::vector<Descriptor> CpuSift::describe(const Oriented& features) const {
  std::vector<Descriptor> descriptors(features.keypoints.size());
  const auto at = [&](std::size_t k) { return static_cast<std::size_t>(features.by_place[k]); };
  for (std::size_t k = 0; k < descriptors.size(); ++k) {
    if (k + 1 < descriptors.size()) {
      prefetch(features.extrema[at(k + 1)], sift::kDescriptorReach);
    }
    const sift::Extremum& extremum = features.extrema[at(k)];
    sift::describe(level_of(extremum), place_in_level(extremum), features.keypoints[at(k)].angle,
                   descriptors[at(k)].data());
  }
  return descriptors;
}

// What the next patch needs comes into the cache while this one is worked on.
void CpuSift::prefetch(const sift::Extremum& extremum, float reach) const {
  sift::prefetch_patch(level_of(extremum), place_in_level(extremum), reach);
}

sift::FixedLevel CpuSift::level_of(const sift::Extremum& extremum) const {
  return scale_space_.level(extremum.octave, extremum.level);
}

std::unique_ptr<SiftExtractor> make_sift(const SiftOptions& options) {
  return std::make_unique<CpuSift>(options);
}

}  // namespace hybrid_slam
