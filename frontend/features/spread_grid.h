#pragma once

#include <algorithm>
#include <cmath>

#include "frontend/features/definition/parameters.h"

// The grid over which select_spread() (feature_selection.h) spreads features, for every engine.

namespace hybrid_slam {

struct SpreadGrid {
  double cell_size = 1;  // [px]
  int columns = 1;
  int rows = 1;

  HS_HOST_DEVICE int cells() const { return columns * rows; }
  HS_HOST_DEVICE int cell_of(float x, float y) const {
    return within((y + 0.5) / cell_size, rows) * columns + within((x + 0.5) / cell_size, columns);
  }

 private:
  HS_HOST_DEVICE static int within(double at, int count) {
    const int cell = static_cast<int>(at);
    return cell < 0 ? 0 : cell < count ? cell : count - 1;
  }
};

inline SpreadGrid make_spread_grid(int width, int height, int max_count) {
  // Cells small enough to spread, large enough that a cell's strongest are worth having.
  constexpr int kKeypointsPerCell = 8;
  const double cells = std::max(1.0, static_cast<double>(max_count) / kKeypointsPerCell);
  SpreadGrid grid;
  grid.cell_size = std::max(1.0, std::sqrt(static_cast<double>(width) * height / cells));
  grid.columns = static_cast<int>(std::ceil(width / grid.cell_size));
  grid.rows = static_cast<int>(std::ceil(height / grid.cell_size));
  return grid;
}

// How many are taken for their strength alone.
inline int strongest_count(int max_count) {
  constexpr double kStrongestShare = 0.75;
  return static_cast<int>(max_count * kStrongestShare);
}

}  // namespace hybrid_slam
