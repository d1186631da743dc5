#include "frontend/tracking/last_frame.h"

#include <utility>

namespace hybrid_slam {

void LastFrame::follow(const MapSnapshot& map) {
  const bool arrived = requested_ && map.newest_frame_index(camera_) >= *requested_;
  if (!tracked_ || !frame_) {
    if (arrived) requested_.reset();
    return;
  }
  if (requested_) {
    const Keyframe* keyframe = map.find_frame(camera_, *requested_);
    if (keyframe != nullptr && cam_from_requested_) {
      reference_ = keyframe->id;
      cam_from_reference_ = *cam_from_requested_;
      const bool is_that = frame_->index == *requested_;
      // Not so if it went out of use before this camera saw anything again.
      const bool has_all_features = keyframe->landmarks.size() == frame_->size();
      if (is_that && has_all_features) frame_->landmarks = keyframe->landmarks;
    }
    if (arrived) requested_.reset();
  }
  if (reference_.valid()) {
    frame_->cam_from_world = cam_from_reference_ * map.cam_from_world(reference_);
  }
}

void LastFrame::remember(Frame frame, const TrackedFrame& result) {
  velocity_.reset();
  if (result.tracked() && tracked_ && frame_) {
    velocity_ = frame.cam_from_world * inverse(frame_->cam_from_world);
  }
  if (result.keyframe) {
    requested_ = frame.index;
    keyframe_frame_ = frame.index;
    keyframe_time_ = frame.time;
    cam_from_requested_ = Rigid3d();
  } else if (cam_from_requested_ && velocity_) {
    cam_from_requested_ = *velocity_ * *cam_from_requested_;
  } else {
    cam_from_requested_.reset();
  }
  if (result.tracked()) {
    reference_ = result.reference;
    cam_from_reference_ = result.cam_from_reference;
  }
  tracked_ = result.tracked();
  frame_ = std::move(frame);
}

}  // namespace hybrid_slam
