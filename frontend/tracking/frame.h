#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/map/frame_observations.h"
#include "backend/map/ids.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/matching/image_pyramid.h"
#include "frontend/matching/keypoint_grid.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {

// A frame of either camera on its way through tracking: what was measured, and what is estimated so
// far. As in the map, the keypoints of a stereo pair are those of its left image; those of a single
// camera are the left ones, and it has no right ones.
struct Frame {
  std::int64_t index = 0;
  double time = 0;                            // [s]
  StereoFeatures features;                    // u_right is empty for a single camera
  KeypointGrid grid;                          // over the (left) keypoints
  std::shared_ptr<const ImagePyramid> image;  // the left one; null where there are features only

  double u_right_correction = 0;  // [px] subtracted from what was measured
  Rigid3d cam_from_world;
  std::vector<LandmarkId> landmarks;   // one per keypoint; invalid where there is none
  std::vector<std::size_t> aligned{};  // keypoints whose positions TrackRefiner moved
  int width = 0;                       // of the (left) image [px]
  int height = 0;

  std::size_t size() const { return features.left.size(); }
};

// Makes a frame whose grid and landmark table fit its features.
Frame make_frame(std::int64_t index, double time, StereoFeatures features, int width, int height);

// The same of a single camera.
Frame make_mono_frame(std::int64_t index, double time, FeatureSet features, int width, int height);

// What the map keeps of a frame that becomes a keyframe.
std::shared_ptr<FrameObservations> make_observations(CameraId camera, const Frame& frame);

}  // namespace hybrid_slam
