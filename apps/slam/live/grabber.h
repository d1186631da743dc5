#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <thread>

#include "apps/slam/live/image_stream.h"
#include "apps/slam/live/stream_inbox.h"

namespace hybrid_slam {

// A stream that is to be listened to.
struct StreamSpec {
  LiveCamera camera = LiveCamera::kLeft;
  std::string name;
  std::function<std::unique_ptr<ImageStream>()> open;  // throws InputError; called by other threads
  bool ends = false;                                   // a file: its end is no loss
  bool retries = false;  // where it cannot be opened at first, it is tried again
  double rate = 0;       // images per second; 0: as the stream says
};

// From when on the streams run, by the clock that goes on steadily and as UNIX time.
struct StreamClock {
  using Clock = std::chrono::steady_clock;
  Clock::time_point start = Clock::now();
  std::int64_t unix_start = std::chrono::duration_cast<std::chrono::nanoseconds>(
                                std::chrono::system_clock::now().time_since_epoch())
                                .count();

  std::int64_t stamp(Clock::time_point time) const {
    return unix_start + std::chrono::duration_cast<std::chrono::nanoseconds>(time - start).count();
  }
};

struct GrabOptions {
  StreamClock clock;
  bool by_position = false;  // stamps are positions in the streams, not arrivals
  bool paced = false;        // images with positions come when they are due
};

// Listens to one stream in a thread of its own: opens it, stamps its images, opens it anew when it
// breaks off. An image that comes less than half a period after the one before was held up on its
// way, as all are that wait in a new connection; its arrival says nothing, and it is left out.
class Grabber {
 public:
  Grabber(StreamSpec spec, std::shared_ptr<StreamInbox> inbox, const GrabOptions& options);

  // The inbox is to be closed before. A thread that a library holds on to is left to itself.
  ~Grabber();
  Grabber(const Grabber&) = delete;
  Grabber& operator=(const Grabber&) = delete;

 private:
  std::future<void> ended_;
  std::thread thread_;
};

}  // namespace hybrid_slam
