#include "frontend/features/feature_selection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace hybrid_slam {
namespace {

// Cells small enough to spread, large enough that a cell's strongest are worth having.
constexpr int kKeypointsPerCell = 8;

struct Grid {
  double cell_size = 1;  // [px]
  int columns = 1;
  int rows = 1;

  std::size_t cell_of(const Keypoint& keypoint) const {
    const int column = std::clamp(static_cast<int>((keypoint.x + 0.5) / cell_size), 0, columns - 1);
    const int row = std::clamp(static_cast<int>((keypoint.y + 0.5) / cell_size), 0, rows - 1);
    return static_cast<std::size_t>(row * columns + column);
  }
};

Grid make_grid(int width, int height, int max_count) {
  const double cells = std::max(1.0, static_cast<double>(max_count) / kKeypointsPerCell);
  Grid grid;
  grid.cell_size = std::max(1.0, std::sqrt(static_cast<double>(width) * height / cells));
  grid.columns = static_cast<int>(std::ceil(width / grid.cell_size));
  grid.rows = static_cast<int>(std::ceil(height / grid.cell_size));
  return grid;
}

bool inside(const Keypoint& keypoint, int width, int height) {
  return keypoint.x >= -0.5F && keypoint.y >= -0.5F &&
         keypoint.x < static_cast<float>(width) - 0.5F &&
         keypoint.y < static_cast<float>(height) - 0.5F;
}

auto strength(const Keypoint& k) { return std::tuple(-k.response, k.y, k.x, k.scale, k.angle); }

// The largest quota per cell with which no more than `max_count` are taken.
int largest_quota(const std::vector<int>& counts, int max_count) {
  int low = 0;
  int high = max_count;
  while (low < high) {
    const int quota = low + (high - low + 1) / 2;
    long taken = 0;
    for (const int count : counts) taken += std::min(count, quota);
    if (taken <= max_count) {
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
  std::vector<int> order;
  order.reserve(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    if (inside(keypoints[i], width, height)) order.push_back(static_cast<int>(i));
  }
  const auto at = [&](int i) -> const Keypoint& { return keypoints[static_cast<std::size_t>(i)]; };
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return strength(at(a)) < strength(at(b)); });
  if (std::ssize(order) <= max_count) return order;

  const Grid grid = make_grid(width, height, max_count);
  std::vector<int> counts(static_cast<std::size_t>(grid.columns) *
                          static_cast<std::size_t>(grid.rows));
  for (const int i : order) ++counts[grid.cell_of(at(i))];
  const int quota = largest_quota(counts, max_count);

  std::vector<int> taken(counts.size(), 0);
  std::vector<char> keep(order.size(), 0);
  int kept = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    int& in_cell = taken[grid.cell_of(at(order[k]))];
    if (in_cell >= quota) continue;
    ++in_cell;
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
