#include "frontend/features/feature_selection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace hybrid_slam {
namespace {

// Cells small enough to spread, large enough that a cell's strongest are worth having.
constexpr int kKeypointsPerCell = 8;
constexpr double kStrongestShare = 0.75;

struct Grid {
  double cell_size = 1;  // [px]
  int columns = 1;
  int rows = 1;

  std::size_t cells() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
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
  const auto strongest = static_cast<std::size_t>(max_count * kStrongestShare);
  std::vector<int> available(grid.cells(), 0);
  std::vector<int> taken(grid.cells(), 0);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::size_t cell = grid.cell_of(at(order[k]));
    ++available[cell];
    if (k < strongest) ++taken[cell];
  }
  const int quota = largest_quota(available, taken, max_count);

  std::vector<char> keep(order.size(), 0);
  int kept = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (k >= strongest) {
      int& in_cell = taken[grid.cell_of(at(order[k]))];
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
