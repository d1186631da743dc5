#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "frontend/features/cuda/cuda_timing.h"
#include "frontend/features/sift.h"

namespace hybrid_slam {

// Empty if there is a device that these kernels can run on, else why not.
std::string why_no_cuda();

// SIFT as defined in frontend/features/definition on a CUDA device. Every instance has a stream and
// memory of its own; what start() enqueues runs while the caller does something else, another
// instance's start(), say. Errors of CUDA are std::runtime_error.
class CudaSift final : public SiftExtractor {
 public:
  // On the current device. Throws std::invalid_argument if the options are not valid, or a blur
  // reaches too far for the kernels (initial_sigma above 3 with 3 layers).
  explicit CudaSift(const SiftOptions& options);
  ~CudaSift() override;

  // start() and finish().
  FeatureSet extract(const GrayImage& image, const GrayImage* mask) override;

  // Enqueues all work for an image, which may change as soon as this returns.
  void start(const GrayImage& image, const GrayImage* mask) override;
  // Waits for what was started last and returns its features.
  FeatureSet finish() override;

  // Times of the image last finished are there if timing was on when it was started.
  void time(CudaTiming timing);
  void time_stages(bool timed) override { time(timed ? CudaTiming::kStages : CudaTiming::kOff); }
  void time_device(bool timed) override { time(timed ? CudaTiming::kWhole : CudaTiming::kOff); }
  CudaStageTimes stage_times() const override;

  // Memory of the device that this instance holds, by the last image's size.
  std::size_t device_bytes() const;

 private:
  friend class CudaFeatures;
  struct Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace hybrid_slam
