#pragma once

#include "frontend/features/cuda/parallel.h"
#include "frontend/features/spread_grid.h"

// select_spread() of frontend/features/feature_selection.h for items that are sorted by strength:
// Spread::enter() for each, then the four kernels below in their order, then Spread::position().

namespace hybrid_slam::cuda {

struct Spread {
  SpreadGrid grid;
  int max_count;
  int strongest;     // so many are taken for their strength alone
  const int* count;  // of items

  // Cleared before the first item is entered.
  int* cell_sizes;  // per cell: items ...
  int* taken;       // ... of them, among the strongest ...
  int* cursors;     // ... of them, listed
  unsigned* kept;   // a bit per item
  // Not cleared.
  int* cell_firsts;  // per cell: in `members`
  int* cells;        // per item
  int* members;      // items, cell by cell, in any order
  int* kept_before;  // per word of `kept`
  int* quota;        // items that a cell gets if it has them
  int* kept_count;

  HS_HOST_DEVICE void enter(int item, float x, float y) const {
    const int cell = grid.cell_of(x, y);
    cells[item] = cell;
    add_to(cell_sizes + cell, 1);
    if (item < strongest) add_to(taken + cell, 1);
  }

  HS_HOST_DEVICE int selected() const { return *count < max_count ? *count : max_count; }

  // Of an item among those selected; -1 if it is none. Where quotas leave room, the strongest that
  // were not kept fill it.
  HS_HOST_DEVICE int position(int item) const {
    const unsigned word = kept[item / 32];
    const unsigned bit = 1U << (item % 32);
    const int before = kept_before[item / 32] + bits_set(word & (bit - 1));
    const int others = item - before;
    const int room = max_count - *kept_count;
    if ((word & bit) == 0 && others >= room) return -1;
    return before + (others < room ? others : room);
  }
};

// One block.
struct FindQuota {
  static constexpr int kThreads = kScanSize;
  using Shared = Scan;

  Spread spread;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& scan) const {
    const int cells = spread.grid.cells();
    int before = 0;
    for (int first = 0; first < cells; first += kScanSize) {
      block.each(kScanSize, [&](int i) {
        scan.values[i] = first + i < cells ? spread.cell_sizes[first + i] : 0;
      });
      running_sums(block, scan);
      block.each(kScanSize, [&](int i) {
        if (first + i < cells) spread.cell_firsts[first + i] = before + scan.before(i);
      });
      before += scan.total;
    }
    int low = 0;
    int high = spread.max_count;
    while (low < high) {
      const int quota = low + (high - low + 1) / 2;
      if (items_kept(block, quota, scan) <= spread.max_count) {
        low = quota;
      } else {
        high = quota - 1;
      }
    }
    block.each(1, [&](int) { *spread.quota = low; });
  }

 private:
  HS_HOST_DEVICE int items_kept(const Block& block, int quota, Scan& scan) const {
    block.each(kScanSize, [&](int i) {
      int sum = 0;
      for (int cell = i; cell < spread.grid.cells(); cell += kScanSize) {
        const int size = spread.cell_sizes[cell];
        const int filled = size < quota ? size : quota;
        const int taken = spread.taken[cell];
        sum += filled > taken ? filled : taken;
      }
      scan.values[i] = sum;
    });
    return sum_of_all(block, scan);
  }
};

// Any number of blocks.
struct ListMembers {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  Spread spread;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(*spread.count, [&](int item) {
      const int cell = spread.cells[item];
      spread.members[spread.cell_firsts[cell] + add_to(spread.cursors + cell, 1)] = item;
    });
  }
};

// Any number of blocks.
struct KeepItems {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  Spread spread;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    const int quota = *spread.quota;
    block.each_of_grid(*spread.count, [&](int item) {
      if (item >= spread.strongest && stronger_in_cell(item, quota) >= quota) return;
      set_bit(spread.kept, static_cast<std::size_t>(item));
    });
  }

 private:
  // Up to `enough`.
  HS_HOST_DEVICE int stronger_in_cell(int item, int enough) const {
    const int cell = spread.cells[item];
    const int size = spread.cell_sizes[cell];
    if (size <= enough) return 0;
    const int* members = spread.members + spread.cell_firsts[cell];
    int count = 0;
    for (int i = 0; i < size && count < enough; ++i) count += members[i] < item;
    return count;
  }
};

// One block.
struct CountKept {
  static constexpr int kThreads = kScanSize;
  using Shared = Scan;

  Spread spread;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& scan) const {
    const int words = (*spread.count + 31) / 32;
    int before = 0;
    for (int first = 0; first < words; first += kScanSize) {
      block.each(kScanSize, [&](int i) {
        scan.values[i] = first + i < words ? bits_set(spread.kept[first + i]) : 0;
      });
      running_sums(block, scan);
      block.each(kScanSize, [&](int i) {
        if (first + i < words) spread.kept_before[first + i] = before + scan.before(i);
      });
      before += scan.total;
    }
    block.each(1, [&](int) { *spread.kept_count = before; });
  }
};

}  // namespace hybrid_slam::cuda
