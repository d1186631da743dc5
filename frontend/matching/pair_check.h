#pragma once

#include "backend/map/features.h"

namespace hybrid_slam {

// Whether two images are the rectified pair that they are taken for. Of matches by their looks
// alone, mutual and clearly the best, wherever in the images they are.
struct PairCheck {
  int matches = 0;
  // Median of the absolute difference of the two rows [px], of matches of small keypoints (up to
  // kSmall px); 0 without any. About 0.3 in a pair that is well rectified.
  double row_error = 0;
  // Share of the matches near the same row whose right place lies to the right of the left one:
  // points behind the cameras, or images that are swapped.
  double reversed = 0;

  static constexpr double kSmall = 3;     // SIFT's scale [px]
  static constexpr double kNearRow = 10;  // [px]
};

// Throws std::logic_error if the two sets' descriptors are of different kinds.
PairCheck check_pair(const FeatureSet& left, const FeatureSet& right);

}  // namespace hybrid_slam
