#pragma once

#include <vector>

#include "frontend/matching/circular_match.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {

struct CircularMatcherOptions {
  double max_descriptor_distance = 0.9;  // L2 between unit descriptors
};

// previous left -> previous right -> current right -> current left -> previous left; kept only if
// the circle closes on itself. Ascending by the previous index.
std::vector<CircularMatch> match_circular(const StereoFeatures& previous,
                                          const StereoFeatures& current,
                                          const CircularMatcherOptions& options);

}  // namespace hybrid_slam
