#pragma once

#include <cstdint>
#include <optional>

#include "backend/map/map_snapshot.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

// What one camera's tracking carries from frame to frame, kept in step with a map that moves on:
// keyframes that were asked for appear in it, poses are corrected. A frame that is not tracked
// changes nothing but tracked(): the next one is compared with the last good one.
class LastFrame {
 public:
  explicit LastFrame(CameraId camera) : camera_(camera) {}

  // Before a frame is tracked against `map`.
  void follow(const MapSnapshot& map);

  // After it: `frame` as it was tracked, and what was said of it.
  void remember(Frame frame, const TrackedFrame& result);

  bool known() const { return frame_.has_value(); }    // whether any frame was tracked
  bool tracked() const { return tracked_; }            // whether the one right before was
  const Frame& frame() const { return *frame_; }       // the last one that was tracked
  KeyframeId reference() const { return reference_; }  // of that
  bool waits_for_keyframe() const { return requested_.has_value(); }
  std::int64_t keyframe_frame() const { return keyframe_frame_; }  // that last became a keyframe
  double keyframe_time() const { return keyframe_time_; }          // [s] of that one

  // The motion from the last tracked frame to a time [s], at constant velocity. Its covariance is
  // that of accelerations as large as those that were seen, which last from the last frame on. None
  // without two tracked frames, or later than one second after the last.
  std::optional<UncertainMotion> constant_velocity(double time) const;

 private:
  void learn_motion(const Rigid3d& step, double seconds);

  CameraId camera_;
  std::optional<Frame> frame_;
  bool tracked_ = false;
  KeyframeId reference_;
  Rigid3d cam_from_reference_;
  std::optional<Vector6d> velocity_;              // logarithm of the last step, per second
  double step_seconds_ = 0;                       // of that
  std::optional<Vector6d> squared_acceleration_;  // mean of those seen
  std::optional<std::int64_t> requested_;         // frame asked to become a keyframe, not yet seen
  // Of the last tracked frame, since then; none if tracking was lost between.
  std::optional<Rigid3d> cam_from_requested_;
  std::int64_t keyframe_frame_ = 0;
  double keyframe_time_ = 0;
};

}  // namespace hybrid_slam
