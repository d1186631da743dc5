#pragma once

#include <stop_token>
#include <thread>

namespace hybrid_slam {

// Turns the first SIGINT or SIGTERM into a request to stop, which wakes whoever waits with the
// token; the second one kills the program as usual. To be made before any other thread: signals are
// blocked in the thread that makes it and in all that come from that.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  std::stop_token token() const { return requested_.get_token(); }

 private:
  void wait(const std::stop_token& finished);

  std::stop_source requested_;
  std::jthread thread_;
};

}  // namespace hybrid_slam
