#pragma once

#include <cstdint>
#include <string>

namespace hybrid_slam {

// When a frame becomes a keyframe. A keyframe costs as much as several frames, so it has to bring
// something: ground that the map does not show yet, or another view of what is about to leave. Both
// are asked in shares of the view, whatever the frame rate, the image's size and the number of
// features. What enough keyframes see already needs no other view: it would be culled at once.
struct KeyframePolicyOptions {
  // Share of the reference keyframe's landmarks that are still in view. More keyframes see each
  // place oftener, fewer cost less: a rendered survey (640x480, 120 frames) has an ATE of 0.054 cm
  // with 48 keyframes (ORB-SLAM2's rule alone), and by overlap 0.058, 0.063, 0.068 and 0.090 cm at
  // 0.9, 0.85, 0.8 and 0.67, with 42, 31, 20 and 12.
  double min_overlap = 0.85;
  // Share of the frame's points that the reference keyframe did not have in view, and that have no
  // landmark.
  double max_new_ground = 0.15;
  // Tracked share of the reference keyframe's landmarks: below it the ground looks different from
  // here. ORB-SLAM2's 0.75 asks for more than most frames find again even a step away.
  double min_tracked_ratio = 0.65;
  double min_tracked_ratio_young = 0.4;  // while the map has fewer than two keyframes
  int min_inliers = 15;  // below it nothing becomes a keyframe, unless tracking is by odometry
  double min_close_tracked = 0.1;  // share of N: with fewer close points tracked ...
  int min_close_untracked = 60;    // ... and this many to be made, a keyframe is needed
  int max_frames_between = 0;      // a keyframe at least this often, when the camera moves; 0: any
  double max_seconds_between = 5;  // likewise [s]; 0: any
  double min_motion = 0.02;        // ... by this share of the scene's median depth

  std::string validate() const;
};

// What is known of a tracked frame when the decision is taken.
struct KeyframeEvidence {
  int inliers = 0;              // landmarks tracked in this frame
  int reference_landmarks = 0;  // well-founded landmarks of the reference keyframe
  double overlap = 1;           // share of these that are in view
  double new_ground = 0;        // share of the frame's points that the reference cannot have seen
  int close_tracked = 0;        // close keypoints with a landmark
  int close_untracked = 0;      // close keypoints without
  int frames_since_keyframe = 0;
  double seconds_since_keyframe = 0;
  std::size_t keyframes = 0;
  double motion = 0;          // distance from the last keyframe over the median depth
  bool is_redundant = false;  // its landmarks are well seen (frontend/mapping/redundancy.h)
  bool by_odometry = false;
};

bool needs_keyframe(const KeyframeEvidence& evidence, int max_features,
                    const KeyframePolicyOptions& options);

}  // namespace hybrid_slam
