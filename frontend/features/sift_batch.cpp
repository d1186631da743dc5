#include "frontend/features/sift_batch.h"

#include <algorithm>
#include <iterator>

namespace hybrid_slam {

SiftBatch::SiftBatch(SiftDevice device, const SiftOptions& options, int images)
    : on_device_(device != SiftDevice::kCpu) {
  // The CPU's engine does all its work in finish(): a second one would only take memory.
  const int engines = on_device_ ? std::max(images, 1) : 1;
  for (int i = 0; i < engines; ++i) {
    engines_.push_back(make_sift_on(device, options));
    if (on_device_) engines_.back()->time_device(true);
  }
}

std::vector<FeatureSet> SiftBatch::extract(std::span<const GrayImage* const> images,
                                           const GrayImage* mask) {
  std::vector<FeatureSet> features;
  device_times_.clear();
  while (!images.empty()) {
    const std::size_t count = std::min(images.size(), engines_.size());
    for (std::size_t i = 0; i < count; ++i) engines_[i]->start(*images[i], mask);
    for (std::size_t i = 0; i < count; ++i) {
      features.push_back(engines_[i]->finish());
      if (on_device_)
        std::ranges::copy(engines_[i]->stage_times(), std::back_inserter(device_times_));
    }
    images = images.subspan(count);
  }
  return features;
}

}  // namespace hybrid_slam
