#include "frontend/tracking/keyframe_policy.h"

namespace hybrid_slam {

std::string KeyframePolicyOptions::validate() const {
  const auto is_share = [](double value) { return value > 0 && value <= 1; };
  if (!is_share(min_tracked_ratio) || !is_share(min_tracked_ratio_young)) {
    return "keyframes: tracked ratios must lie in (0, 1]";
  }
  if (!(min_overlap >= 0 && min_overlap <= 1) || !(max_new_ground >= 0 && max_new_ground <= 1)) {
    return "keyframes: min_overlap and max_new_ground must lie in [0, 1]";
  }
  if (min_inliers < 0 || !(min_close_tracked >= 0) || min_close_untracked < 0 ||
      max_frames_between < 0 || !(max_seconds_between >= 0) || !(min_motion >= 0)) {
    return "keyframes: counts, times and shares must not be negative";
  }
  return {};
}

bool needs_keyframe(const KeyframeEvidence& evidence, int max_features,
                    const KeyframePolicyOptions& options) {
  if (evidence.by_odometry) {
    return true;  // the map does not reach here: grow it
  }
  if (evidence.inliers <= options.min_inliers) {
    return false;
  }
  const double min_ratio =
      evidence.keyframes < 2 ? options.min_tracked_ratio_young : options.min_tracked_ratio;
  // What has left the view is missed only where the rest is seen from here for the first times.
  const double expected =
      evidence.reference_landmarks * (evidence.is_redundant ? evidence.overlap : 1);
  const bool weak = evidence.inliers < min_ratio * expected;
  const bool needs_close = evidence.close_tracked < options.min_close_tracked * max_features &&
                           evidence.close_untracked > options.min_close_untracked;
  const bool is_new = evidence.new_ground > options.max_new_ground;
  const bool has_moved_on = evidence.overlap < options.min_overlap;
  const bool is_late = (options.max_frames_between > 0 &&
                        evidence.frames_since_keyframe >= options.max_frames_between) ||
                       (options.max_seconds_between > 0 &&
                        evidence.seconds_since_keyframe >= options.max_seconds_between);
  const bool another_view = has_moved_on || (is_late && evidence.motion > options.min_motion);
  return is_new || weak || needs_close || (another_view && !evidence.is_redundant);
}

}  // namespace hybrid_slam
