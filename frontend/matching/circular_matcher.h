#pragma once

#include <vector>

#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {

// A point seen in all four images of two successive stereo frames; indices into the left keypoints.
struct CircularMatch {
  int previous = 0;
  int current = 0;
};

struct CircularMatcherOptions {
  double max_descriptor_distance = 0.9;  // L2 between unit descriptors
};

// previous left -> previous right -> current right -> current left -> previous left; kept only if
// the circle closes on itself. Ascending by the previous index.
std::vector<CircularMatch> match_circular(const StereoFeatures& previous,
                                          const StereoFeatures& current,
                                          const CircularMatcherOptions& options);

}  // namespace hybrid_slam
