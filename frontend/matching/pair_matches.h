#pragma once

#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// A match between two images by the looks of their features alone, wherever they are: mutual and
// clearly the best.
struct PairMatch {
  float x = 0;          // in the left image [px]
  float y = 0;          // [px]
  float rows = 0;       // row in the left image less that in the right one [px]
  float disparity = 0;  // column in the left image less that in the right one [px]
  float scale = 0;      // SIFT's, the larger one of the two [px]
};

// Throws std::logic_error if the two sets' descriptors are of different kinds.
std::vector<PairMatch> match_pair(const FeatureSet& left, const FeatureSet& right);

}  // namespace hybrid_slam
