#include "frontend/features/cuda/cuda_sift.h"

#include "frontend/features/cuda/cuda_sift_engine.cuh"

namespace hybrid_slam {

std::string why_no_cuda() {
  int count = 0;
  cudaError_t error = cudaGetDeviceCount(&count);
  if (error == cudaSuccess && count == 0) error = cudaErrorNoDevice;
  cudaFuncAttributes kernel;  // none if this was not compiled for such a device
  if (error == cudaSuccess) {
    error = cudaFuncGetAttributes(&kernel, cuda::run_kernel<cuda::FindExtrema>);
  }
  if (error == cudaSuccess) return {};
  cudaGetLastError();  // or a later call would report it
  return std::string("no CUDA device: ") + cudaGetErrorString(error);
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

std::size_t CudaSift::device_bytes() const { return engine_->sift.backend().device_bytes(); }

void CudaSift::time(CudaTiming timing) { engine_->sift.backend().time(timing); }

CudaStageTimes CudaSift::stage_times() const { return engine_->sift.backend().stage_times(); }

}  // namespace hybrid_slam
