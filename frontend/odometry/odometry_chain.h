#pragma once

#include <memory>
#include <optional>

#include "backend/map/odometry.h"
#include "frontend/odometry/stereo_odometer.h"

namespace hybrid_slam {

// The odometer's motions since the last frame that became a keyframe, one after the other.
class OdometryChain {
 public:
  // The present frame becomes a keyframe.
  void begin() {
    since_ = UncertainMotion();
    last_.reset();
  }

  // From the last frame to the present one. None, or one that nobody believes, ends the chain until
  // the next keyframe.
  void add(const std::optional<StereoMotion>& motion) {
    if (motion && since_) {
      since_ = UncertainMotion{motion->current_from_previous, motion->covariance} * *since_;
      last_ = motion;
    } else {
      since_.reset();
      last_.reset();
    }
  }

  // The same, of a motion that another than the odometer knows: nothing was followed, and a present
  // frame that becomes a keyframe has what it knows in its landmarks.
  void bridge(const UncertainMotion& motion) {
    if (since_) since_ = motion * *since_;
    last_.reset();
  }

  // What the present frame takes along as a keyframe; null where the chain is broken or
  // was bridged to this frame. `previous`: the keyframe that it began with.
  std::shared_ptr<const Odometry> odometry(KeyframeId previous) const;

 private:
  std::optional<UncertainMotion> since_;
  std::optional<StereoMotion> last_;
};

}  // namespace hybrid_slam
