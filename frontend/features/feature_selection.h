#pragma once

#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// Which `max_count` of the keypoints to keep: the strongest of each cell of a grid over the image,
// as many per cell as still fit, so that no part of the image starves another; what is left of
// `max_count` goes to the strongest of the rest. Keypoints outside the image are left out. Two
// orientations at one place count as two. Strength is the response; equal ones are ordered by y, x,
// scale and angle, so that the result does not depend on the order of the input.
// Returns indices in that order of strength.
std::vector<int> select_spread(const std::vector<Keypoint>& keypoints, int width, int height,
                               int max_count);

}  // namespace hybrid_slam
