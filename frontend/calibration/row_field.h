#pragma once

#include <vector>

#include "frontend/calibration/image_cells.h"

namespace hybrid_slam {

// Differences of the rows of stereo matches (left less right [px]) by place in the left image, over
// a run.
class RowField {
 public:
  RowField() = default;
  RowField(int width, int height) : cells_(width, height), moments_(cells_.size()) {}

  void add(double x, double y, double row_difference) {
    moments_[cells_.of(x, y)].add(row_difference);
  }

  const ImageCells& cells() const { return cells_; }
  const Moments& at(std::size_t cell) const { return moments_[cell]; }

  // Root of the mean square of the cells' means, and of what is left of them without the noise of
  // the means [px], over all matches.
  double systematic_rms() const;

 private:
  ImageCells cells_;
  std::vector<Moments> moments_;
};

}  // namespace hybrid_slam
