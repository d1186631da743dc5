#include "frontend/features/cpu/cpu_sift.h"

#include <algorithm>
#include <cmath>

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
  detect(image, mask);
  const std::vector<sift::Extremum> selected = select();
  Oriented oriented = orient(selected);
  FeatureSet features;
  features.kind = DescriptorKind::kRootSift;
  features.descriptors = describe(oriented);
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
  std::vector<sift::Extremum> selected;
  for (const int i : select_spread(keypoints, width_, height_, options_.max_features)) {
    selected.push_back(extrema_[static_cast<std::size_t>(i)]);
  }
  return selected;
}

CpuSift::Oriented CpuSift::orient(const std::vector<sift::Extremum>& extrema) const {
  Oriented all;
  for (const sift::Extremum& extremum : extrema) {
    float angles[sift::kMaxOrientations];
    const sift::LevelView level = scale_space_.level(extremum.octave, extremum.level);
    const int count = sift::find_angles(level, place_in_level(extremum), angles);
    for (int i = 0; i < count; ++i) {
      all.keypoints.push_back(keypoint_of(extremum));
      all.keypoints.back().angle = angles[i];
      all.extrema.push_back(&extremum);
    }
  }
  Oriented kept;
  for (const int i : select_spread(all.keypoints, width_, height_, options_.max_features)) {
    kept.keypoints.push_back(all.keypoints[static_cast<std::size_t>(i)]);
    kept.extrema.push_back(all.extrema[static_cast<std::size_t>(i)]);
  }
  return kept;
}

std::vector<Descriptor> CpuSift::describe(const Oriented& features) const {
  std::vector<Descriptor> descriptors(features.keypoints.size());
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    const sift::Extremum& extremum = *features.extrema[i];
    sift::describe(scale_space_.level(extremum.octave, extremum.level), place_in_level(extremum),
                   features.keypoints[i].angle, descriptors[i].data());
  }
  return descriptors;
}

std::unique_ptr<SiftExtractor> make_sift(const SiftOptions& options) {
  return std::make_unique<CpuSift>(options);
}

}  // namespace hybrid_slam
