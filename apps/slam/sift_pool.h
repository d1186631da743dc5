#pragma once

#include <condition_variable>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "frontend/features/sift_batch.h"

namespace hybrid_slam {

// Extractors of SIFT that the threads of a run share. On the CPU every thread that asks gets one;
// on a device there are kOnDevice, whatever the number of threads, so that the device's memory is
// bounded: one works there while another one's images and features are copied by the host.
class SiftPool {
 public:
  static constexpr int kOnDevice = 2;
  static constexpr int kUnbounded = std::numeric_limits<int>::max();

  // Each extractor takes so many images at a time; they are made when they are first needed.
  SiftPool(SiftDevice device, const SiftOptions& options, int images)
      : SiftPool(device, options, images, device == SiftDevice::kCpu ? kUnbounded : kOnDevice) {}
  SiftPool(SiftDevice device, const SiftOptions& options, int images, int limit);

  // An extractor for the caller alone, until the lease ends. Any thread.
  using Lease = std::unique_ptr<SiftBatch, std::function<void(SiftBatch*)>>;
  // Waits until there is one. Throws as SiftBatch does.
  Lease take();

  bool bounded() const { return limit_ != kUnbounded; }
  int made() const;

 private:
  std::unique_ptr<SiftBatch> idle_or_new();
  void give_back(std::unique_ptr<SiftBatch> sift);

  const SiftDevice device_;
  const SiftOptions options_;
  const int images_;
  const int limit_;

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable returned_;
  std::vector<std::unique_ptr<SiftBatch>> idle_;
  int made_ = 0;
};

}  // namespace hybrid_slam
