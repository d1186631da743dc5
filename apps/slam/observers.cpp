#include "apps/slam/observers.h"

#include <utility>

namespace hybrid_slam {

Observers::Observers(SessionObservers observers, bool own_thread, SessionObservers inner)
    : observers_(std::move(observers)),
      inner_(std::move(inner)),
      events_(SessionObservers::kBacklog) {
  if (own_thread) thread_.emplace([this] { work(); });
}

void Observers::tell(Event event) {
  if (!thread_) {
    event();
    return;
  }
  if (events_.try_push(std::move(event))) return;
  const std::lock_guard lock(mutex_);
  ++overruns_;
}

void Observers::work() {
  try {
    while (const auto event = events_.pop()) (*event)();
  } catch (...) {
    events_.close();
    const std::lock_guard lock(mutex_);
    thrown_ = std::current_exception();
  }
}

void Observers::frame(FrameResult frame) {
  if (inner_.frame) inner_.frame(frame);
  if (!observers_.frame && !observers_.state) return;
  tell([this, frame = std::move(frame)] {
    if (observers_.frame) observers_.frame(frame);
    tell_state(frame);
  });
}

void Observers::tell_state(const FrameResult& frame) {
  if (frame.camera != CameraKind::kStereo || frame.state == state_) return;
  const TrackingState before = std::exchange(state_, frame.state);
  if (observers_.state) observers_.state(before, state_);
}

void Observers::keyframe(const KeyframeResult& keyframe) {
  if (inner_.keyframe) inner_.keyframe(keyframe);
  if (observers_.keyframe) tell([this, keyframe] { observers_.keyframe(keyframe); });
}

void Observers::loop(LoopRecord loop) {
  if (observers_.loop) tell([this, loop = std::move(loop)] { observers_.loop(loop); });
}

void Observers::map(std::shared_ptr<const MapSnapshot> map, MapChange change) {
  if (observers_.map) tell([this, map, change] { observers_.map(map, change); });
  if (inner_.map && observers_.corrected) inner_.map(map, change);
}

void Observers::failure(SessionFailure failure) {
  if (!observers_.failure) return;
  tell([this, failure = std::move(failure)] { observers_.failure(failure); });
}

void Observers::left_out(const LeftOut& input) {
  if (observers_.left_out) tell([this, input] { observers_.left_out(input); });
}

void Observers::corrected(std::vector<CorrectedPose> poses) {
  if (poses.empty() || !observers_.corrected) return;
  tell([this, poses = std::move(poses)] { observers_.corrected(poses); });
}

void Observers::finish() {
  events_.close();
  if (thread_ && thread_->joinable()) thread_->join();
}

std::int64_t Observers::overruns() const {
  const std::lock_guard lock(mutex_);
  return overruns_;
}

void Observers::rethrow() const {
  const std::lock_guard lock(mutex_);
  if (thrown_) std::rethrow_exception(thrown_);
}

}  // namespace hybrid_slam
