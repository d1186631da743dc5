#pragma once

#include "frontend/features/cuda/extremum_kernels.h"
#include "frontend/features/cuda/response_order.h"
#include "frontend/features/cuda/selection_kernels.h"

// Sorts extrema by strength: into buckets, then by counting within a bucket. The result does not
// depend on the order in which they were found.

namespace hybrid_slam::cuda {

struct Sorting {
  Found found;
  int* cursors;        // per bucket, cleared before
  int* bucket_firsts;  // per bucket
  Extremum* bucketed;  // bucket by bucket, in any order
  Extremum* sorted;    // the strongest first
  int* count;          // of them
  Spread spread;       // which they are entered into
};

// One block.
struct PlaceBuckets {
  static constexpr int kThreads = kScanSize;
  using Shared = Scan;

  Sorting sorting;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& scan) const {
    constexpr int kEach = kBuckets / kScanSize;
    static_assert(kBuckets % kScanSize == 0);
    const int* sizes = sorting.found.bucket_sizes;
    block.each(kScanSize, [&](int i) {
      int sum = 0;
      for (int k = 0; k < kEach; ++k) sum += sizes[i * kEach + k];
      scan.values[i] = sum;
    });
    running_sums(block, scan);
    block.each(kScanSize, [&](int i) {
      int sum = scan.before(i);
      for (int k = 0; k < kEach; ++k) {
        sorting.bucket_firsts[i * kEach + k] = sum;
        sum += sizes[i * kEach + k];
      }
      if (i == 0) *sorting.count = sorting.found.stored();
    });
  }
};

// Any number of blocks.
struct FillBuckets {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  Sorting sorting;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(*sorting.count, [&](int i) {
      const Extremum extremum = sorting.found.extrema[i];
      const int bucket = bucket_of(extremum.response);
      const int slot = sorting.bucket_firsts[bucket] + add_to(sorting.cursors + bucket, 1);
      sorting.bucketed[slot] = extremum;
    });
  }
};

// Any number of blocks.
struct SortBuckets {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  Sorting sorting;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(*sorting.count, [&](int i) {
      const Extremum extremum = sorting.bucketed[i];
      const int bucket = bucket_of(extremum.response);
      const int first = sorting.bucket_firsts[bucket];
      const Extremum* others = sorting.bucketed + first;
      int rank = first;
      for (int k = 0; k < sorting.found.bucket_sizes[bucket]; ++k) {
        rank += stronger(others[k], extremum);
      }
      sorting.sorted[rank] = extremum;
      sorting.spread.enter(rank, extremum.x, extremum.y);
    });
  }
};

// Any number of blocks.
struct GatherExtrema {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  Sorting sorting;
  Extremum* selected;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(*sorting.count, [&](int i) {
      const int position = sorting.spread.position(i);
      if (position >= 0) selected[position] = sorting.sorted[i];
    });
  }
};

}  // namespace hybrid_slam::cuda
