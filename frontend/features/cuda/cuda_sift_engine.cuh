#pragma once

#include "frontend/features/cuda/cuda_sift.h"
#include "frontend/features/cuda/on_device.cuh"
#include "frontend/features/cuda/sift_engine.h"

namespace hybrid_slam {

struct CudaSift::Engine {
  explicit Engine(const SiftOptions& options) : sift(options) {}

  cuda::SiftEngine<cuda::OnDevice> sift;
};

}  // namespace hybrid_slam
