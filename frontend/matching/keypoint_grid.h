#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// Finds keypoints near a place. Immutable once built; any number of threads may query it.
class KeypointGrid {
 public:
  // Keeps the positions, not the keypoints. `cell_size` [px]: about the radius of a usual query.
  KeypointGrid(std::span<const Keypoint> keypoints, int width, int height, double cell_size = 16);

  // Appends the indices of all keypoints within `radius` [px] of (x, y), the rim included, ordered
  // by cell (rows first) and within a cell by index. Nothing is allocated but the output's growth.
  void query(double x, double y, double radius, std::vector<int>* found) const;

 private:
  struct Entry {
    float x;
    float y;
    int index;
  };

  int column_of(double x) const;
  int row_of(double y) const;

  double cell_size_;
  int columns_;
  int rows_;
  std::vector<Entry> entries_;                // cell by cell
  std::vector<std::uint32_t> first_of_cell_;  // one per cell and the end
};

}  // namespace hybrid_slam
