#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>

#include "backend/map/map_snapshot.h"
#include "frontend/matching/image_pyramid.h"
#include "frontend/matching/patch_alignment.h"
#include "frontend/tracking/frame.h"

namespace hybrid_slam {

struct TrackRefinementOptions {
  bool enabled = true;
  int keyframes = 30;              // of which the images are kept as references, newest
  double sigma = 0.15;             // standard deviation of an aligned position [px of its level]
  double max_view_angle_deg = 35;  // between the two views of a patch
  AlignmentOptions alignment;

  // Small patches: lamps that move along with the camera shade the ground anew from every place,
  // and what is large in an image is shifted by that most. Of patches of 15 samples the scale of
  // two rendered surveys came out 0.08 and 0.25 % too small, of 9 samples 0.05 and 0.11 %.
  TrackRefinementOptions() { alignment.half_size = 4; }

  std::string validate() const;
};

// Moves the keypoints that were matched to landmarks to where the image looks like the patch around
// the landmark's first observation: all frames then measure the very same point, to a small part of
// a pixel, which SIFT's own positions do not.
class TrackRefiner {
 public:
  TrackRefiner(CameraId camera_id, const Camera& camera, const TrackRefinementOptions& options);

  // The frame becomes a keyframe: its image can serve as reference.
  void remember(const Frame& frame);

  // Aligns the frame's matched keypoints, given a pose good to about a pixel. Changes their
  // positions, right coordinates and standard deviations. Returns how many.
  int refine(const MapSnapshot& map, Frame& frame) const;

 private:
  struct Reference;

  const ImagePyramid* image_of(std::int64_t frame_index) const;
  bool find_reference(const MapSnapshot& map, const Landmark& landmark, Reference& reference) const;
  bool refine_keypoint(const MapSnapshot& map, const Landmark& landmark, std::size_t index,
                       Frame& frame) const;

  CameraId camera_id_;
  Camera camera_;
  TrackRefinementOptions options_;
  std::deque<std::pair<std::int64_t, std::shared_ptr<const ImagePyramid>>>
      images_;  // by frame index, ascending
};

}  // namespace hybrid_slam
