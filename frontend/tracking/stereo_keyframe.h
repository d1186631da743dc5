#pragma once

#include <optional>

#include "backend/map/map_edit.h"
#include "backend/map/map_snapshot.h"
#include "frontend/tracking/frame.h"

namespace hybrid_slam {

// Keypoints of a frame of which no landmark shall be made, one entry each; empty: none. For what
// moves by itself.
using LeftOutKeypoints = std::vector<bool>;

// What a stereo frame sees at depths that one pair can tell.
struct StereoCoverage {
  int close_tracked = 0;    // close keypoints with a landmark
  int close_untracked = 0;  // close keypoints without
  double median_depth = 0;  // of all keypoints with a right match [m]
};

// `close_depth` [m]: nearer points are close. None if no keypoint has a depth.
std::optional<StereoCoverage> stereo_coverage(const Camera& camera, const Frame& frame,
                                              double close_depth,
                                              const LeftOutKeypoints& left_out = {});

// Landmarks of a keyframe that enough others have seen to be relied on; 0 if it has been culled.
int count_well_founded(const MapSnapshot& map, KeyframeId keyframe);

// What a frame and its reference keyframe see of each other's ground, found again or not.
struct ReferenceOverlap {
  int landmarks = 0;   // well-founded ones of the reference
  int in_view = 0;     // of these, inside the frame's image
  int points = 0;      // of the frame, with depth
  int new_points = 0;  // of these, without a landmark and outside the reference's image

  double share() const { return landmarks == 0 ? 0 : static_cast<double>(in_view) / landmarks; }
  double new_ground() const { return points == 0 ? 0 : static_cast<double>(new_points) / points; }
};
ReferenceOverlap reference_overlap(const MapSnapshot& map, KeyframeId reference,
                                   const Camera& camera, const Frame& frame,
                                   const LeftOutKeypoints& left_out = {});

// The frame as a keyframe with its landmarks. Of the keypoints with depth and without a landmark,
// every close one makes a new point, and at least the `min_new_points` nearest do.
NewKeyframe make_stereo_keyframe(CameraId camera_id, const Camera& camera, const Frame& frame,
                                 KeyframeId reference, double close_depth, int min_new_points,
                                 const LeftOutKeypoints& left_out = {});

// Takes out of a keyframe what shall be no landmark, unless it is one already: mapping would make
// landmarks of it between keyframes, and find places by it.
void leave_out(const LeftOutKeypoints& left_out, NewKeyframe& keyframe);

}  // namespace hybrid_slam
