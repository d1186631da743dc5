#include "frontend/matching/keypoint_grid.h"

#include <algorithm>
#include <cmath>

namespace hybrid_slam {

KeypointGrid::KeypointGrid(std::span<const Keypoint> keypoints, int width, int height,
                           double cell_size)
    : cell_size_(cell_size),
      columns_(std::max(1, static_cast<int>(std::ceil(width / cell_size)))),
      rows_(std::max(1, static_cast<int>(std::ceil(height / cell_size)))) {
  const auto cell_of = [&](const Keypoint& k) {
    return static_cast<std::size_t>(row_of(k.y) * columns_ + column_of(k.x));
  };
  first_of_cell_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1,
                        0);
  for (const Keypoint& k : keypoints) ++first_of_cell_[cell_of(k) + 1];
  for (std::size_t c = 1; c < first_of_cell_.size(); ++c) {
    first_of_cell_[c] += first_of_cell_[c - 1];
  }
  std::vector<std::uint32_t> next(first_of_cell_.begin(), first_of_cell_.end() - 1);
  entries_.resize(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& k = keypoints[i];
    entries_[next[cell_of(k)]++] = {k.x, k.y, static_cast<int>(i)};
  }
}

// Clamped in floating point first: any finite place has a cell.
int KeypointGrid::column_of(double x) const {
  return static_cast<int>(std::clamp(std::floor(x / cell_size_), 0.0, columns_ - 1.0));
}

int KeypointGrid::row_of(double y) const {
  return static_cast<int>(std::clamp(std::floor(y / cell_size_), 0.0, rows_ - 1.0));
}

void KeypointGrid::query(double x, double y, double radius, std::vector<int>* found) const {
  if (!(radius >= 0) || !std::isfinite(x) || !std::isfinite(y)) return;
  const int first_column = column_of(x - radius);
  const int last_column = column_of(x + radius);
  const int last_row = row_of(y + radius);
  for (int row = row_of(y - radius); row <= last_row; ++row) {
    // The cells of a row lie side by side.
    const auto cell = static_cast<std::size_t>(row * columns_);
    const std::uint32_t begin = first_of_cell_[cell + static_cast<std::size_t>(first_column)];
    const std::uint32_t end = first_of_cell_[cell + static_cast<std::size_t>(last_column) + 1];
    for (std::uint32_t e = begin; e < end; ++e) {
      const double dx = entries_[e].x - x;
      const double dy = entries_[e].y - y;
      if (dx * dx + dy * dy <= radius * radius) found->push_back(entries_[e].index);
    }
  }
}

}  // namespace hybrid_slam
