#pragma once

#include <vector>

#include "backend/map/features.h"
#include "cameras/camera.h"
#include "cameras/rectified_stereo.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

struct StereoMatcherOptions {
  double max_row_difference = 1.0;       // [px] in addition to the keypoints' own uncertainty
  double min_disparity = 0.1;            // [px]; zero disparity is infinite depth
  double max_descriptor_distance = 0.9;  // L2 between unit descriptors
  double ratio = 0.9;                    // best against second best along the row
  bool refine = true;  // sub-pixel disparity by aligning patches of the two images
};

// The features of a rectified pair and which of them are the same point.
struct StereoFeatures {
  FeatureSet left;
  FeatureSet right;
  std::vector<int> right_of_left;  // one per left keypoint: index of the right one, or -1
  std::vector<float> u_right;      // one per left keypoint [px], kNoRightMatch where there is none
};

}  // namespace hybrid_slam
