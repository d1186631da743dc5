#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "apps/pipeline/channel.h"

namespace hybrid_slam {

// Stands in for a live camera: hands out indices at a fixed rate and drops what nobody takes in
// time.
class PacedCamera {
 public:
  // A request to stop ends it at once, also while it waits.
  PacedCamera(std::size_t total, double rate, std::stop_token cancelled);

  // Waits for the next index; none at the end.
  std::optional<std::size_t> next() { return indices_.pop(); }

  // No further image; waits for the thread. Returns how many were dropped.
  int finish();

 private:
  using Clock = std::chrono::steady_clock;

  void work(const std::stop_token& stop, std::size_t total, double rate);
  bool wait_until(Clock::time_point due, const std::stop_token& stop);

  Channel<std::size_t> indices_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  int dropped_ = 0;  // the thread's own until finish()
  std::jthread thread_;
  std::stop_callback<std::function<void()>> cancel_;
};

}  // namespace hybrid_slam
