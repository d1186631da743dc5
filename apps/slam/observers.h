#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "apps/slam/channel.h"
#include "apps/slam/session_types.h"

namespace hybrid_slam {

// Tells a session's observers, at once or in a thread of its own. Any thread may call.
class Observers {
 public:
  // `own_thread`: else who calls waits until all have been told. `inner` are told at once in any
  // case, before the others.
  Observers(SessionObservers observers, bool own_thread, SessionObservers inner = {});
  ~Observers() { finish(); }

  void frame(FrameResult frame);
  void keyframe(const KeyframeResult& keyframe);
  void loop(LoopRecord loop);
  void map(std::shared_ptr<const MapSnapshot> map, MapChange change);
  void failure(SessionFailure failure);
  void left_out(const LeftOut& input);
  void corrected(std::vector<CorrectedPose> poses);

  // Tells what waits, then nothing any more.
  void finish();

  // Events that were left out because others waited.
  std::int64_t overruns() const;

  // What an observer threw, in the thread of its own.
  void rethrow() const;

 private:
  using Event = std::function<void()>;
  void tell(Event event);
  void tell_state(const FrameResult& frame);
  void work();

  SessionObservers observers_;
  SessionObservers inner_;
  TrackingState state_ = TrackingState::kStarting;  // of whoever tells
  Channel<Event> events_;
  mutable std::mutex mutex_;
  std::int64_t overruns_ = 0;  // guarded by mutex_
  std::exception_ptr thrown_;  // guarded by mutex_
  std::optional<std::jthread> thread_;
};

}  // namespace hybrid_slam
