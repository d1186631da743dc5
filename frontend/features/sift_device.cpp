#include "frontend/features/sift_device.h"

#include <stdexcept>

#ifdef HYBRID_SLAM_WITH_CUDA
#include "frontend/features/cuda/blur_weights.h"
#include "frontend/features/cuda/cuda_sift.h"
#endif

namespace hybrid_slam {

std::string to_string(SiftDevice device) { return device == SiftDevice::kCpu ? "cpu" : "cuda"; }

#ifdef HYBRID_SLAM_WITH_CUDA

std::string why_no_cuda_sift(const SiftOptions& options) {
  const std::string why_not = why_no_cuda();
  return why_not.empty() ? cuda::why_blurs_too_large(options) : why_not;
}

std::unique_ptr<SiftExtractor> make_sift_on(SiftDevice device, const SiftOptions& options) {
  if (device == SiftDevice::kCpu) return make_sift(options);
  return std::make_unique<CudaSift>(options);
}

#else

std::string why_no_cuda_sift(const SiftOptions&) {
  return "this build has no CUDA (CMake option HYBRID_SLAM_CUDA)";
}

std::unique_ptr<SiftExtractor> make_sift_on(SiftDevice device, const SiftOptions& options) {
  if (device == SiftDevice::kCpu) return make_sift(options);
  throw std::runtime_error(why_no_cuda_sift(options));
}

#endif

}  // namespace hybrid_slam
