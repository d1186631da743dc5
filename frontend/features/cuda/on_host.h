#pragma once

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "frontend/features/cuda/parallel.h"

namespace hybrid_slam::cuda {

// Runs kernels on the host, block by block. Memory is poisoned: what a kernel reads without having
// written it is NaN as a float and far off as an integer.
class OnHost {
 public:
  static constexpr unsigned char kPoison = 0xFF;

  explicit OnHost(bool backward = false) : backward_(backward) {}
  ~OnHost() { release(); }
  OnHost(const OnHost&) = delete;
  OnHost& operator=(const OnHost&) = delete;

  // Memory of this backend, and memory of the host that it copies from and to. Valid until
  // release().
  void* allocate(std::size_t bytes) {
    device_bytes_ += bytes;
    return memory(bytes);
  }
  void* allocate_for_host(std::size_t bytes) { return memory(bytes); }
  void release() {
    for (void* block : blocks_) std::free(block);
    blocks_.clear();
    device_bytes_ = 0;
  }
  std::size_t device_bytes() const { return device_bytes_; }  // by allocate()

  void clear(void* to, std::size_t bytes) { std::memset(to, 0, bytes); }
  void upload(void* to, const void* from, std::size_t bytes) { std::memcpy(to, from, bytes); }
  void download(void* to, const void* from, std::size_t bytes) { std::memcpy(to, from, bytes); }
  // Done when it returns.
  void upload_now(void* to, const void* from, std::size_t bytes) { std::memcpy(to, from, bytes); }

  template <typename Kernel>
  void launch(const Grid& grid, const Kernel& kernel) {
    const auto shared = std::make_unique<typename Kernel::Shared>();
    const int blocks = grid.x * grid.y * grid.z;
    for (int i = 0; i < blocks; ++i) {
      std::memset(static_cast<void*>(shared.get()), kPoison, sizeof *shared);
      const int b = backward_ ? blocks - 1 - i : i;
      kernel(Block{b % grid.x, b / grid.x % grid.y, b / grid.x / grid.y, grid.x, backward_},
             *shared);
    }
  }

  // Runs what `launches` launches. On a device this is recorded, and the next time the record is
  // run, unless forget() or release() has been called.
  template <typename Launches>
  void record(const Launches& launches) {
    launches();
  }
  void forget() {}
  void begin_stage(const char*) {}
  void wait() {}

 private:
  void* memory(std::size_t bytes) {
    blocks_.push_back(std::malloc(bytes > 0 ? bytes : 1));
    if (blocks_.back() == nullptr) throw std::bad_alloc();
    return std::memset(blocks_.back(), kPoison, bytes);
  }

  bool backward_;
  std::vector<void*> blocks_;
  std::size_t device_bytes_ = 0;
};

}  // namespace hybrid_slam::cuda
