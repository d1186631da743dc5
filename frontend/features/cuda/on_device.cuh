#pragma once

#include <cuda_runtime.h>

#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "frontend/features/cuda/cuda_timing.h"
#include "frontend/features/cuda/parallel.h"

namespace hybrid_slam::cuda {

inline void check(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return;
  throw std::runtime_error(std::string("CUDA: ") + what + ": " + cudaGetErrorString(error));
}

template <typename Kernel>
__global__ void __launch_bounds__(Kernel::kThreads)
    run_kernel(const __grid_constant__ Kernel kernel) {
  __shared__ typename Kernel::Shared shared;
  kernel(Block{static_cast<int>(blockIdx.x), static_cast<int>(blockIdx.y),
               static_cast<int>(blockIdx.z), static_cast<int>(gridDim.x)},
         shared);
}

// Runs kernels on the current device, in a stream of its own.
class OnDevice {
 public:
  OnDevice() { check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream"); }
  ~OnDevice() {
    cudaStreamSynchronize(stream_);
    drop_record();
    for (void* memory : device_memory_) cudaFree(memory);
    for (void* memory : host_memory_) cudaFreeHost(memory);
    for (const auto& [name, event] : stages_) cudaEventDestroy(event);
    cudaStreamDestroy(stream_);
  }
  OnDevice(const OnDevice&) = delete;
  OnDevice& operator=(const OnDevice&) = delete;

  void* allocate(std::size_t bytes) {
    void* memory = nullptr;
    check(cudaMalloc(&memory, bytes > 0 ? bytes : 1), "memory of the device");
    device_memory_.push_back(memory);
    device_bytes_ += bytes;
    return memory;
  }
  void* allocate_for_host(std::size_t bytes) {
    void* memory = nullptr;
    check(cudaMallocHost(&memory, bytes > 0 ? bytes : 1), "pinned memory");
    host_memory_.push_back(memory);
    return memory;
  }
  void release() {
    wait();
    drop_record();
    device_bytes_ = 0;
    for (void* memory : std::exchange(device_memory_, {})) check(cudaFree(memory), "release");
    for (void* memory : std::exchange(host_memory_, {})) check(cudaFreeHost(memory), "release");
  }

  void clear(void* to, std::size_t bytes) {
    check(cudaMemsetAsync(to, 0, bytes, stream_), "clear");
  }
  void upload(void* to, const void* from, std::size_t bytes) {
    check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream_), "upload");
  }
  void download(void* to, const void* from, std::size_t bytes) {
    check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream_), "download");
  }
  void copy(void* to, const void* from, std::size_t bytes) {
    check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToDevice, stream_), "copy");
  }
  void upload_now(void* to, const void* from, std::size_t bytes) {
    upload(to, from, bytes);
    wait();
  }

  template <typename Kernel>
  void launch(const Grid& grid, const Kernel& kernel) {
    const dim3 blocks(static_cast<unsigned>(grid.x), static_cast<unsigned>(grid.y),
                      static_cast<unsigned>(grid.z));
    run_kernel<<<blocks, Kernel::kThreads, 0, stream_>>>(kernel);
    check(cudaGetLastError(), "launch");
  }

  template <typename Launches>
  void record(const Launches& launches) {
    if (timing_ == CudaTiming::kStages) {
      launches();
      return;
    }
    begin_stage("kernels");
    if (record_ == nullptr) make_record(launches);
    check(cudaGraphLaunch(record_, stream_), "run");
  }
  void forget() {
    wait();
    drop_record();
  }
  void wait() { check(cudaStreamSynchronize(stream_), "wait"); }

  // A stage ends where the next begins, the last one where `nullptr` begins.
  void time(CudaTiming timing) { timing_ = timing; }
  void begin_stage(const char* name) {
    if (timing_ == CudaTiming::kOff || recording_) return;
    if (ended_) used_stages_ = 0;
    ended_ = name == nullptr;
    if (used_stages_ == stages_.size()) {
      cudaEvent_t event = nullptr;
      check(cudaEventCreate(&event), "event");
      stages_.emplace_back(nullptr, event);
    }
    stages_[used_stages_].first = name;
    check(cudaEventRecord(stages_[used_stages_++].second, stream_), "event");
  }
  // Of the last run, after wait().
  CudaStageTimes stage_times() const {
    CudaStageTimes times;
    for (std::size_t i = 0; i + 1 < used_stages_; ++i) {
      float milliseconds = 0;
      check(cudaEventElapsedTime(&milliseconds, stages_[i].second, stages_[i + 1].second), "event");
      times.emplace_back(stages_[i].first, milliseconds);
    }
    return times;
  }

  cudaStream_t stream() const { return stream_; }
  std::size_t device_bytes() const { return device_bytes_; }  // allocated

 private:
  template <typename Launches>
  void make_record(const Launches& launches) {
    check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "record");
    recording_ = true;
    cudaGraph_t graph = nullptr;
    try {
      launches();
    } catch (...) {
      recording_ = false;
      cudaStreamEndCapture(stream_, &graph);
      if (graph != nullptr) cudaGraphDestroy(graph);
      throw;
    }
    recording_ = false;
    check(cudaStreamEndCapture(stream_, &graph), "record");
    const cudaError_t error = cudaGraphInstantiate(&record_, graph, 0);
    cudaGraphDestroy(graph);
    check(error, "record");
  }
  void drop_record() {
    if (record_ != nullptr) cudaGraphExecDestroy(record_);
    record_ = nullptr;
  }

  cudaStream_t stream_ = nullptr;
  cudaGraphExec_t record_ = nullptr;
  std::vector<void*> device_memory_;
  std::size_t device_bytes_ = 0;
  std::vector<void*> host_memory_;
  bool recording_ = false;
  CudaTiming timing_ = CudaTiming::kOff;
  bool ended_ = true;
  std::size_t used_stages_ = 0;
  std::vector<std::pair<const char*, cudaEvent_t>> stages_;
};

}  // namespace hybrid_slam::cuda
