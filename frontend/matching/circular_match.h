#pragma once

namespace hybrid_slam {

// A point seen in all four images of two successive stereo frames; indices into the left keypoints.
struct CircularMatch {
  int previous = 0;
  int current = 0;
};

}  // namespace hybrid_slam
