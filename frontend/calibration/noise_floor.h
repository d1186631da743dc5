#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "backend/map/features.h"
#include "frontend/calibration/image_cells.h"

namespace hybrid_slam {

// What a camera's calibration is off by, by place in its image: a variance that is added to that of
// each keypoint, since no keypoint's own noise tells of it. Immutable.
class NoiseFloor {
 public:
  // `variance`: by cell [px^2], per coordinate.
  NoiseFloor(const ImageCells& cells, std::vector<double> variance)
      : cells_(cells), variance_(std::move(variance)) {}

  double variance(double x, double y) const { return variance_[cells_.of(x, y)]; }

  // A standard deviation [px] with what lies under it.
  float over(float sigma, double x, double y) const {
    return static_cast<float>(std::sqrt(double{sigma} * double{sigma} + variance(x, y)));
  }

  void raise(FeatureSet& features) const {
    for (Keypoint& keypoint : features.keypoints) {
      keypoint.sigma = over(keypoint.sigma, keypoint.x, keypoint.y);
    }
  }

 private:
  ImageCells cells_;
  std::vector<double> variance_;
};

}  // namespace hybrid_slam
