#pragma once

#include "frontend/features/definition/descriptor.h"
#include "frontend/features/definition/orientation.h"

namespace hybrid_slam::sift {

// The weights of the samples of a grid, which are the same for every feature.
struct PatchTables {
  // Padded with zeros to whole vectors of eight.
  float orientation_window[kOrientationSide][(kOrientationSide + 7) / 8 * 8] = {};
  // Of sample cell * kSamplesPerCell + i in a cell.
  float cell_share[kCells][2 * kSamplesPerCell] = {};

  PatchTables() {
    for (int row = 0; row < kOrientationSide; ++row) {
      for (int column = 0; column < kOrientationSide; ++column) {
        orientation_window[row][column] =
            sift::orientation_window(column - kOrientationRadius, row - kOrientationRadius);
      }
    }
    for (int cell = 0; cell < kCells; ++cell) {
      for (int i = 0; i < 2 * kSamplesPerCell; ++i) {
        cell_share[cell][i] = sift::cell_share(cell, cell * kSamplesPerCell + i);
      }
    }
  }
};

inline const PatchTables kTables;

}  // namespace hybrid_slam::sift
