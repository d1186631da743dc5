#include "frontend/features/cuda/cuda_sift.h"

#include "frontend/features/cuda/cuda_sift_engine.cuh"

namespace hybrid_slam {

std::string why_no_cuda() {
  int count = 0;
  const cudaError_t error = cudaGetDeviceCount(&count);
  if (error != cudaSuccess) {
    cudaGetLastError();  // or a later call would report it
    return cudaGetErrorString(error);
  }
  return count > 0 ? "" : "no CUDA device";
}

CudaSift::CudaSift(const SiftOptions& options) : engine_(std::make_unique<Engine>(options)) {}
CudaSift::~CudaSift() = default;

FeatureSet CudaSift::extract(const GrayImage& image, const GrayImage* mask) {
  start(image, mask);
  return finish();
}

void CudaSift::start(const GrayImage& image, const GrayImage* mask) {
  engine_->sift.start(image, mask);
}

FeatureSet CudaSift::finish() { return engine_->sift.finish(); }

void CudaSift::time_stages(bool timed) { engine_->sift.backend().time_stages(timed); }

std::vector<std::pair<std::string, double>> CudaSift::stage_times() const {
  return engine_->sift.backend().stage_times();
}

}  // namespace hybrid_slam
