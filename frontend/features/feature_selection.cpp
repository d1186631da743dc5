#include "frontend/features/feature_selection.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <tuple>

#include "frontend/features/key_sort.h"
#include "frontend/features/spread_grid.h"

namespace hybrid_slam {
namespace {

bool inside(const Keypoint& keypoint, int width, int height) {
  return keypoint.x >= -0.5F && keypoint.y >= -0.5F &&
         keypoint.x < static_cast<float>(width) - 0.5F &&
         keypoint.y < static_cast<float>(height) - 0.5F;
}

auto strength(const Keypoint& k) { return std::tuple(-k.response, k.y, k.x, k.scale, k.angle); }

// The larger a number, the smaller its key.
std::uint32_t descending_key(float value) {
  constexpr std::uint32_t kSign = 0x80000000U;
  const auto bits = std::bit_cast<std::uint32_t>(value + 0.0F);  // of zeros, the positive one
  return (bits & kSign) != 0 ? bits : ~(bits | kSign);
}

// Those inside the image. The response decides nearly always.
std::vector<int> by_strength(const std::vector<Keypoint>& keypoints, int width, int height) {
  std::vector<Keyed> ranked;
  ranked.reserve(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    if (!inside(keypoints[i], width, height)) continue;
    ranked.push_back({descending_key(keypoints[i].response), static_cast<std::uint32_t>(i)});
  }
  sort_by_key(ranked);
  for (auto begin = ranked.begin(); begin != ranked.end();) {
    const auto end = std::find_if(begin, ranked.end(),
                                  [&](const Keyed& other) { return other.key != begin->key; });
    if (end - begin > 1) {
      std::sort(begin, end, [&](const Keyed& a, const Keyed& b) {
        return strength(keypoints[a.index]) < strength(keypoints[b.index]);
      });
    }
    begin = end;
  }
  std::vector<int> order;
  order.reserve(ranked.size());
  for (const Keyed& one : ranked) order.push_back(static_cast<int>(one.index));
  return order;
}

// The largest quota to which cells can be filled up, from what they have, with no more than
// `max_count` in all.
int largest_quota(const std::vector<int>& available, const std::vector<int>& taken, int max_count) {
  int low = 0;
  int high = max_count;
  while (low < high) {
    const int quota = low + (high - low + 1) / 2;
    long total = 0;
    for (std::size_t cell = 0; cell < taken.size(); ++cell) {
      total += std::max(taken[cell], std::min(available[cell], quota));
    }
    if (total <= max_count) {
      low = quota;
    } else {
      high = quota - 1;
    }
  }
  return low;
}

}  // namespace

std::vector<int> select_spread(const std::vector<Keypoint>& keypoints, int width, int height,
                               int max_count) {
  const auto at = [&](int i) -> const Keypoint& { return keypoints[static_cast<std::size_t>(i)]; };
  std::vector<int> order = by_strength(keypoints, width, height);
  if (std::ssize(order) <= max_count) return order;

  const SpreadGrid grid = make_spread_grid(width, height, max_count);
  const auto cell_of = [&](int i) {
    return static_cast<std::size_t>(grid.cell_of(at(i).x, at(i).y));
  };
  const auto strongest = static_cast<std::size_t>(strongest_count(max_count));
  std::vector<int> available(static_cast<std::size_t>(grid.cells()), 0);
  std::vector<int> taken(available);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::size_t cell = cell_of(order[k]);
    ++available[cell];
    if (k < strongest) ++taken[cell];
  }
  const int quota = largest_quota(available, taken, max_count);

  std::vector<char> keep(order.size(), 0);
  int kept = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (k >= strongest) {
      int& in_cell = taken[cell_of(order[k])];
      if (in_cell >= quota) continue;
      ++in_cell;
    }
    ++kept;
    keep[k] = 1;
  }
  for (std::size_t k = 0; k < order.size() && kept < max_count; ++k) {
    if (keep[k]) continue;
    keep[k] = 1;
    ++kept;
  }
  std::vector<int> selected;
  selected.reserve(static_cast<std::size_t>(kept));
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (keep[k]) selected.push_back(order[k]);
  }
  return selected;
}

}  // namespace hybrid_slam
