#pragma once

#include <string>
#include <vector>

#include "backend/map/features.h"
#include "cameras/camera.h"
#include "cameras/rectified_stereo.h"
#include "frontend/matching/image_pyramid.h"
#include "frontend/matching/patch_alignment.h"

namespace hybrid_slam {

struct StereoMatcherOptions {
  double max_row_difference = 1.0;       // [px] in addition to the keypoints' own uncertainty
  double min_disparity = 0.1;            // [px]; zero disparity is infinite depth
  double min_depth = 1.5;                // nearest depth [baselines], the largest disparity
  double max_scale_ratio = 1.5;          // of the two keypoints' scales
  double max_descriptor_distance = 0.9;  // L2 between unit descriptors
  double ratio = 0.9;                    // best against second best along the row
  bool refine = true;  // sub-pixel disparity by aligning patches of the two images
  AlignmentOptions alignment{.horizontal_only = true};

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// The features of a rectified pair and which of them are the same point.
struct StereoFeatures {
  FeatureSet left;
  FeatureSet right;
  std::vector<int> right_of_left;  // one per left keypoint: index of the right one, or -1
  std::vector<float> u_right;      // one per left keypoint [px], kNoRightMatch where there is none
};

// Matches along the rows: each left feature with the most similar right feature of nearly its row
// and scale and of a possible disparity, if it is clearly the most similar and the choice is
// mutual. With both images and options.refine, the right place is then refined by aligning the
// right image with the left keypoint's patch; a match whose patches do not fit is dropped, one
// whose patch would leave an image keeps the right keypoint's place. Null images: no refinement.
// Throws std::logic_error if the two sets' descriptors are of different kinds.
StereoFeatures match_stereo(FeatureSet left, FeatureSet right, const ImagePyramid* left_image,
                            const ImagePyramid* right_image,
                            const Calibrated<RectifiedStereo>& camera,
                            const StereoMatcherOptions& options);

}  // namespace hybrid_slam
