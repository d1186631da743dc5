#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "apps/slam/live/image_set.h"

namespace hybrid_slam {

// What became of a stream.
struct StreamEvent {
  enum class Kind {
    kImage,
    kOpened,  // anew: the images to come are of another connection
    kLost,    // it is tried again; `text`: why
    kEnded,   // there will be no more
    kFailed,  // it cannot be opened, and never will; `text`: why
  };
  LiveCamera camera = LiveCamera::kLeft;
  Kind kind = Kind::kImage;
  StampedImage image{};
  std::string text{};
};

// Where the threads that listen to cameras put what comes, and one thread takes it. Of each camera
// few images wait. Thread-safe.
class StreamInbox {
 public:
  using Clock = std::chrono::steady_clock;

  // `drop`: where too many images of a camera wait, the oldest goes; else put() waits.
  explicit StreamInbox(bool drop) : drop_(drop) {}

  // False once it is closed.
  bool put(StreamEvent event);
  void count_held_up(LiveCamera camera);

  // Sleeps. False once it is closed.
  bool wait_until(Clock::time_point time);

  // Waits for the next event; none at `deadline`, or when `stop` is requested. Those of a camera
  // that is `held` are left for later.
  std::optional<StreamEvent> next(const std::stop_token& stop, Clock::time_point deadline,
                                  const PerCamera<bool>& held = {});

  void close();

  std::size_t waiting(LiveCamera camera) const;  // images
  PerCamera<std::int64_t> dropped() const;
  PerCamera<std::int64_t> held_up() const;

 private:
  static constexpr std::size_t kMostImages = 4;  // per camera

  void drop_oldest(LiveCamera camera);

  const bool drop_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable_any changed_;
  std::deque<StreamEvent> events_;
  PerCamera<std::size_t> waiting_{};  // images among them
  PerCamera<std::int64_t> dropped_{};
  PerCamera<std::int64_t> held_up_{};
  bool closed_ = false;
};

}  // namespace hybrid_slam
