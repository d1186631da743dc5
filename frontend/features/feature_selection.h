#pragma once

#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// Which `max_count` of the keypoints to keep. Three quarters are the strongest of all; the rest go,
// strongest first, to the cells of a grid over the image that have the fewest, so that no part of
// the image is left empty. (All spread alike, a fifth fewer features find a match in the next
// frame: the weak ones repeat less. None spread, parts of the image are empty.) Keypoints outside
// the image are left out. Two orientations at one place count as two. Strength is the response;
// equal ones are ordered by y, x, scale and angle, so that the result does not depend on the order
// of the input. Returns indices in that order of strength.
std::vector<int> select_spread(const std::vector<Keypoint>& keypoints, int width, int height,
                               int max_count);

}  // namespace hybrid_slam
