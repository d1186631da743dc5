#include "frontend/tracking/last_frame.h"

#include <utility>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {
namespace {

constexpr double kMaxSeconds = 1;    // for which a velocity holds; uncertain long before
constexpr double kRemembered = 0.9;  // of the mean of accelerations, per step

bool is_same(const Keypoint& a, const Keypoint& b) {
  return a.x == b.x && a.y == b.y && a.scale == b.scale && a.angle == b.angle;
}

// Those of the keyframe that the frame became. It has the same keypoints in the same order, but
// some may have been left out.
void take_landmarks(const Keyframe& keyframe, Frame& frame) {
  const std::vector<Keypoint>& kept = keyframe.observations->features.keypoints;
  const std::vector<Keypoint>& all = frame.features.left.keypoints;
  std::size_t next = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool is_kept = next < kept.size() && is_same(kept[next], all[i]);
    frame.landmarks[i] = is_kept ? keyframe.landmarks[next++] : LandmarkId();
  }
}

}  // namespace

void LastFrame::follow(const MapSnapshot& map) {
  if (!frame_) {
    return;
  }
  if (requested_) {
    const Keyframe* keyframe = map.find_frame(camera_, *requested_);
    if (keyframe != nullptr && cam_from_requested_) {
      reference_ = keyframe->id;
      cam_from_reference_ = *cam_from_requested_;
      if (frame_->index == *requested_) take_landmarks(*keyframe, *frame_);
    }
    if (map.newest_frame_index(camera_) >= *requested_) {
      requested_.reset();
    }
  }
  if (reference_.valid()) {
    frame_->cam_from_world = cam_from_reference_ * map.cam_from_world(reference_);
  }
}

void LastFrame::remember(Frame frame, const TrackedFrame& result) {
  tracked_ = result.tracked();
  if (!tracked_) return;
  std::optional<Rigid3d> step;
  const bool goes_on =
      result.source != PoseSource::kRelocalization && result.source != PoseSource::kInitialization;
  if (frame_ && goes_on) {
    step = frame.cam_from_world * inverse(frame_->cam_from_world);
    learn_motion(*step, frame.time - frame_->time);
  } else {
    velocity_.reset();
  }
  if (result.keyframe) {
    requested_ = frame.index;
    keyframe_frame_ = frame.index;
    keyframe_time_ = frame.time;
    cam_from_requested_ = Rigid3d();
  } else if (cam_from_requested_ && step) {
    cam_from_requested_ = *step * *cam_from_requested_;
  } else {
    cam_from_requested_.reset();
  }
  reference_ = result.reference;
  cam_from_reference_ = result.cam_from_reference;
  frame_ = std::move(frame);
}

void LastFrame::learn_motion(const Rigid3d& step, double seconds) {
  const std::optional<Vector6d> before = std::exchange(velocity_, std::nullopt);
  if (!(seconds > 0)) return;
  velocity_ = se3_log(step) / seconds;
  if (before) {
    const Vector6d acceleration = 2 * (*velocity_ - *before) / (step_seconds_ + seconds);
    Vector6d squared;  // alike in all directions: few steps tell little of each
    squared << Eigen::Vector3d::Constant(acceleration.head<3>().squaredNorm() / 3),
        Eigen::Vector3d::Constant(acceleration.tail<3>().squaredNorm() / 3);
    squared_acceleration_ =
        squared_acceleration_
            ? Vector6d(kRemembered * *squared_acceleration_ + (1 - kRemembered) * squared)
            : squared;
  }
  step_seconds_ = seconds;
}

// The velocity is that of the middle of the last step.
std::optional<UncertainMotion> LastFrame::constant_velocity(double time) const {
  if (!frame_ || !velocity_) return std::nullopt;
  const double seconds = time - frame_->time;
  const bool next = tracked_ && seconds <= 2 * step_seconds_;
  if (!(seconds > 0) || (seconds > kMaxSeconds && !next)) return std::nullopt;
  // As long as none was seen: within a step it may stop, or double.
  const Vector6d acceleration = squared_acceleration_
                                    ? Vector6d(squared_acceleration_->cwiseSqrt())
                                    : Vector6d(velocity_->cwiseAbs() / step_seconds_);
  const Vector6d sigma = acceleration * (0.5 * seconds * (seconds + step_seconds_));
  return UncertainMotion{se3_exp(Vector6d(*velocity_ * seconds)),
                         Matrix6d(sigma.cwiseAbs2().asDiagonal())};
}

}  // namespace hybrid_slam
