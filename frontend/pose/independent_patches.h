#pragma once

#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// How many keypoints tell something of their own: chosen, the finest first, so that the squares
// that two descriptors were made of never overlap by more than half of the larger one. Where one of
// a pile of them is matched wrongly, as to another rib of a radiator, the others are as well:
// together they are one piece of evidence. SIFT describes squares of 12 sigma (Lowe, IJCV
// 2004, 6.1: four bins of three sigma along each side).
int count_independent(std::vector<Keypoint> keypoints);

}  // namespace hybrid_slam
