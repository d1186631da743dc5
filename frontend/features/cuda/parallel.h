#pragma once

#include <cstddef>

#include "frontend/features/definition/parameters.h"

// Kernels that run on a device and, for tests, on the host. A kernel is a plain struct: its members
// are the arguments, `Shared` is what the threads of a block share, and
//
//   HS_HOST_DEVICE void operator()(const Block& block, Shared& shared) const;
//
// is what a block does: a sequence of phases, block.each(...), with a barrier after each. Nothing
// else may depend on the thread, so that the same source is a block of kThreads threads on a device
// and a few loops on a host. The backends (on_host.h, on_device.h) run a kernel for every block of
// a grid.

#ifdef __CUDA_ARCH__
#define HS_UNROLL _Pragma("unroll")
#else
#define HS_UNROLL
#endif

namespace hybrid_slam::cuda {

struct Grid {
  int x = 1;
  int y = 1;
  int z = 1;
};

struct Block {
  int x = 0;  // which of the grid
  int y = 0;
  int z = 0;
  int blocks = 1;         // of the grid, along x
  bool backward = false;  // on a host: from the last to the first. Results must not depend on it.

  // body(i) for i = 0 .. count - 1, in any order, at once as far as there are threads; then a
  // barrier. `count` is the same for all threads.
  template <typename Body>
  HS_HOST_DEVICE void each(int count, const Body& body) const {
#ifdef __CUDA_ARCH__
    for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
      body(i);
    }
    __syncthreads();
#else
    for (int i = 0; i < count; ++i) body(backward ? count - 1 - i : i);
#endif
  }

  // The same shared among all blocks of a grid that has no y and z; without a barrier.
  template <typename Body>
  HS_HOST_DEVICE void each_of_grid(int count, const Body& body) const {
#ifdef __CUDA_ARCH__
    const int threads = static_cast<int>(blockDim.x);
    for (int i = x * threads + static_cast<int>(threadIdx.x); i < count; i += blocks * threads) {
      body(i);
    }
#else
    for (int i = x; i < count; i += blocks) body(i);
#endif
  }
};

// Of a kernel whose threads share nothing.
struct NothingShared {};

// Adds at once for all threads; returns what was there.
HS_HOST_DEVICE inline int add_to(int* number, int value) {
#ifdef __CUDA_ARCH__
  return atomicAdd(number, value);
#else
  const int before = *number;
  *number += value;
  return before;
#endif
}

// Sets a bit of an array of words, at once for all threads; returns whether it was set.
HS_HOST_DEVICE inline bool set_bit(unsigned* words, std::size_t bit) {
  const unsigned mask = 1U << (bit % 32);
#ifdef __CUDA_ARCH__
  return (atomicOr(words + bit / 32, mask) & mask) != 0;
#else
  const bool before = (words[bit / 32] & mask) != 0;
  words[bit / 32] |= mask;
  return before;
#endif
}

HS_HOST_DEVICE inline int bits_set(unsigned word) {
#ifdef __CUDA_ARCH__
  return __popc(word);
#else
  return __builtin_popcount(word);
#endif
}

constexpr int kScanSize = 1024;

// Numbers of a block that are summed up.
struct Scan {
  int values[kScanSize];
  int sums[kScanSize];
  int total;

  // After running_sums(): of the numbers before this one.
  HS_HOST_DEVICE int before(int i) const { return i == 0 ? 0 : values[i - 1]; }
};

// Replaces each number by the sum of those up to it, and `total` by the sum of all.
HS_HOST_DEVICE inline void running_sums(const Block& block, Scan& scan) {
  int* from = scan.values;
  int* to = scan.sums;
  for (int step = 1; step < kScanSize; step *= 2) {
    block.each(kScanSize, [&](int i) {
      to[i] = from[i] + (i < step ? 0 : from[i - step]);
      if (i == kScanSize - 1) scan.total = to[i];
    });
    int* const written = to;
    to = from;
    from = written;
  }
}

// The sum of all alone.
HS_HOST_DEVICE inline int sum_of_all(const Block& block, Scan& scan) {
  constexpr int kParts = 32;
  block.each(kParts, [&](int part) {
    int sum = 0;
    for (int i = part; i < kScanSize; i += kParts) sum += scan.values[i];
    scan.sums[part] = sum;
  });
  block.each(1, [&](int) {
    int sum = 0;
    for (int part = 0; part < kParts; ++part) sum += scan.sums[part];
    scan.total = sum;
  });
  return scan.total;
}

}  // namespace hybrid_slam::cuda
