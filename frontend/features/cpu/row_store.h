#pragma once

#include <cstddef>
#include <cstdint>

#include <hwy/aligned_allocator.h>

#include "frontend/features/cpu/row_kernels.h"

namespace hybrid_slam::sift {

// The rows of an image, or the last `capacity` of them: row y takes the place of row y - capacity.
template <typename Sample>
class RowStoreOf {
 public:
  RowStoreOf(int width, int capacity);

  Sample* row(int y) { return samples_.get() + static_cast<std::size_t>(y % capacity_) * stride_; }
  const Sample* row(int y) const {
    return samples_.get() + static_cast<std::size_t>(y % capacity_) * stride_;
  }
  std::size_t stride() const { return stride_; }

 private:
  int capacity_;
  std::size_t stride_;
  hwy::AlignedFreeUniquePtr<Sample[]> samples_;
};

using RowStore = RowStoreOf<float>;
using FixedRowStore = RowStoreOf<std::uint16_t>;

// One row with room at both ends for what a kernel reads beyond it.
class PaddedRow {
 public:
  PaddedRow(int width, int reach);

  float* samples() { return samples_.get() + before_; }

  // Mirrors the row at its ends, once it is written.
  void mirror();

 private:
  int width_;
  int reach_;
  std::size_t before_;
  hwy::AlignedFreeUniquePtr<float[]> samples_;
};

}  // namespace hybrid_slam::sift
