#pragma once

#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "frontend/features/sift_device.h"

namespace hybrid_slam {

// SIFT of several images at a time. On a CUDA device they are worked on side by side, each in a
// stream and memory of its own; on the CPU one after the other. Used by one thread at a time.
class SiftBatch {
 public:
  // For so many images at a time; more are taken in turns. Throws as make_sift_on() does.
  SiftBatch(SiftDevice device, const SiftOptions& options, int images);

  // The features of each image, as SiftExtractor::extract() finds them. `mask` is for all of them.
  std::vector<FeatureSet> extract(std::span<const GrayImage* const> images, const GrayImage* mask);

  // What the device did for the images last extracted, each in its turn: upload, kernels, download;
  // milliseconds by the device's clock. Side by side they take less than their sum. Empty on the
  // CPU.
  const std::vector<std::pair<std::string, double>>& device_times() const { return device_times_; }

 private:
  bool on_device_;
  std::vector<std::unique_ptr<SiftExtractor>> engines_;
  std::vector<std::pair<std::string, double>> device_times_;
};

}  // namespace hybrid_slam
