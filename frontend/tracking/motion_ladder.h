#pragma once

#include <optional>

#include "frontend/odometry/stereo_odometer.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

// How a frame moved since another one, found on the first rung that can be believed.
struct LadderStep {
  StereoMotion motion;
  Prediction rung = Prediction::kNone;
  bool believed = false;  // else no accident, but too uncertain for more than to begin a search
};

// Frame to frame, without the map: matches that close a circle; then those of the left image alone,
// since blur takes the right image's first; then patches that optical flow follows, since blur
// takes descriptors next. Each later rung is tried only where the ones before failed. All hold for
// large motions and need no prediction.
class MotionLadder {
 public:
  // Throws std::invalid_argument if the options are not valid.
  MotionLadder(const Calibrated<RectifiedStereo>& camera, const StereoOdometerOptions& options)
      : camera_(camera), odometer_(camera, options) {}

  std::optional<LadderStep> climb(const Frame& from, const Frame& to) const;

 private:
  Calibrated<RectifiedStereo> camera_;
  StereoOdometer odometer_;
};

}  // namespace hybrid_slam
