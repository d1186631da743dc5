#pragma once

#include "frontend/features/cuda/on_host.h"
#include "frontend/features/cuda/sift_engine.h"
#include "frontend/features/sift.h"

namespace hybrid_slam {

// The kernels of the CUDA engine, run on the host. `backward`: threads and blocks from the last to
// the first, which must change nothing: what differs would be a race on a device.
class HostCudaSift final : public SiftExtractor {
 public:
  explicit HostCudaSift(const SiftOptions& options, bool backward = false)
      : engine_(options, backward) {}

  FeatureSet extract(const GrayImage& image, const GrayImage* mask) override {
    engine_.start(image, mask);
    return engine_.finish();
  }
  cuda::SiftEngine<cuda::OnHost>& engine() { return engine_; }

 private:
  cuda::SiftEngine<cuda::OnHost> engine_;
};

}  // namespace hybrid_slam
