#pragma once

#include <cstdint>
#include <string>

namespace hybrid_slam {

// When a frame becomes a keyframe. The thresholds are those of ORB-SLAM2's stereo mode, loosened
// for low frame rates and many features.
struct KeyframePolicyOptions {
  double min_tracked_ratio = 0.75;       // tracked share of the reference keyframe's landmarks
  double min_tracked_ratio_young = 0.4;  // while the map has fewer than two keyframes
  int min_inliers = 15;  // below it nothing becomes a keyframe, unless tracking is by odometry
  double min_close_tracked = 0.1;  // share of N: with fewer close points tracked ...
  int min_close_untracked = 60;    // ... and this many to be made, a keyframe is needed
  int max_frames_between = 15;     // a keyframe at least this often, when the camera moves
  double min_motion = 0.02;        // ... by this share of the scene's median depth

  std::string validate() const;
};

// What is known of a tracked frame when the decision is taken.
struct KeyframeEvidence {
  int inliers = 0;              // landmarks tracked in this frame
  int reference_landmarks = 0;  // well-founded landmarks of the reference keyframe
  int close_tracked = 0;        // close keypoints with a landmark
  int close_untracked = 0;      // close keypoints without
  int frames_since_keyframe = 0;
  std::size_t keyframes = 0;
  double motion = 0;  // distance from the last keyframe over the median depth
  bool by_odometry = false;
};

bool needs_keyframe(const KeyframeEvidence& evidence, int max_features,
                    const KeyframePolicyOptions& options);

}  // namespace hybrid_slam
