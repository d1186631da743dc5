#include "apps/slam/live/stream_inbox.h"

#include <algorithm>
#include <utility>

namespace hybrid_slam {

bool StreamInbox::put(StreamEvent event) {
  std::unique_lock lock(mutex_);
  const LiveCamera camera = event.camera;
  const bool is_image = event.kind == StreamEvent::Kind::kImage;
  if (is_image && !drop_) {
    changed_.wait(lock, [&] { return closed_ || of(waiting_, camera) < kMostImages; });
  }
  if (closed_) return false;
  if (is_image && of(waiting_, camera) >= kMostImages) drop_oldest(camera);
  if (is_image) ++of(waiting_, camera);
  events_.push_back(std::move(event));
  changed_.notify_all();
  return true;
}

void StreamInbox::drop_oldest(LiveCamera camera) {
  const auto oldest = std::find_if(events_.begin(), events_.end(), [&](const StreamEvent& event) {
    return event.camera == camera && event.kind == StreamEvent::Kind::kImage;
  });
  events_.erase(oldest);
  --of(waiting_, camera);
  ++of(dropped_, camera);
}

void StreamInbox::count_held_up(LiveCamera camera) {
  const std::lock_guard lock(mutex_);
  ++of(held_up_, camera);
}

bool StreamInbox::wait_until(Clock::time_point time) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_until(lock, time, [&] { return closed_; });
}

std::optional<StreamEvent> StreamInbox::next(const std::stop_token& stop,
                                             Clock::time_point deadline,
                                             const PerCamera<bool>& held) {
  std::unique_lock lock(mutex_);
  const auto first = [&] {
    return std::find_if(events_.begin(), events_.end(),
                        [&](const StreamEvent& event) { return !of(held, event.camera); });
  };
  changed_.wait_until(lock, stop, deadline, [&] { return first() != events_.end(); });
  const auto found = first();
  if (found == events_.end() || stop.stop_requested()) return std::nullopt;
  StreamEvent event = std::move(*found);
  events_.erase(found);
  if (event.kind == StreamEvent::Kind::kImage) --of(waiting_, event.camera);
  changed_.notify_all();
  return event;
}

void StreamInbox::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  events_.clear();
  changed_.notify_all();
}

std::size_t StreamInbox::waiting(LiveCamera camera) const {
  const std::lock_guard lock(mutex_);
  return of(waiting_, camera);
}

PerCamera<std::int64_t> StreamInbox::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

PerCamera<std::int64_t> StreamInbox::held_up() const {
  const std::lock_guard lock(mutex_);
  return held_up_;
}

}  // namespace hybrid_slam
