#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/map/ids.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/matching/image_pyramid.h"
#include "frontend/matching/keypoint_grid.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {

// A stereo frame on its way through tracking: what was measured, and what is estimated so far.
struct Frame {
  std::int64_t index = 0;
  double time = 0;  // [s]
  StereoFeatures features;
  KeypointGrid grid;                         // over the left keypoints
  std::shared_ptr<const ImagePyramid> left;  // null where there are features only

  double u_right_correction = 0;  // [px] subtracted from what was measured
  Rigid3d cam_from_world;
  std::vector<LandmarkId> landmarks;  // one per left keypoint; invalid where there is none

  std::size_t size() const { return features.left.size(); }
};

// Makes a frame whose grid and landmark table fit its features.
Frame make_frame(std::int64_t index, double time, StereoFeatures features, int width, int height);

}  // namespace hybrid_slam
