#pragma once

#include <cstdint>
#include <optional>

#include "backend/map/map_snapshot.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

// What one camera's tracking carries from frame to frame, kept in step with a map that moves on:
// keyframes that were asked for appear in it, poses are corrected.
class LastFrame {
 public:
  explicit LastFrame(CameraId camera) : camera_(camera) {}

  // Before a frame is tracked against `map`.
  void follow(const MapSnapshot& map);

  // After it: `frame` as it was tracked, and what was said of it.
  void remember(Frame frame, const TrackedFrame& result);

  bool tracked() const { return tracked_; }
  const Frame& frame() const { return *frame_; }       // the last one, tracked or not
  KeyframeId reference() const { return reference_; }  // of the last tracked frame
  bool waits_for_keyframe() const { return requested_.has_value(); }
  std::int64_t keyframe_frame() const { return keyframe_frame_; }  // that last became a keyframe
  double keyframe_time() const { return keyframe_time_; }          // [s] of that one

  // current_from_previous of the last step; none unless both frames were tracked.
  const std::optional<Rigid3d>& velocity() const { return velocity_; }

 private:
  CameraId camera_;
  std::optional<Frame> frame_;
  bool tracked_ = false;
  KeyframeId reference_;
  Rigid3d cam_from_reference_;
  std::optional<Rigid3d> velocity_;
  std::optional<std::int64_t> requested_;  // frame asked to become a keyframe, not yet seen
  // Of the last frame, since then; none if tracking was lost between.
  std::optional<Rigid3d> cam_from_requested_;
  std::int64_t keyframe_frame_ = 0;
  double keyframe_time_ = 0;
};

}  // namespace hybrid_slam
