#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace hybrid_slam {

// For engines: how long the stages of one image took.
class StageStopwatch {
 public:
  // A new image.
  void start() {
    times_.clear();
    last_ = Clock::now();
  }

  // The time since the last lap, or since start(), belongs to `stage`.
  void lap(const char* stage) {
    const Clock::time_point now = Clock::now();
    times_.emplace_back(stage, std::chrono::duration<double, std::milli>(now - last_).count());
    last_ = now;
  }

  // Milliseconds.
  const std::vector<std::pair<std::string, double>>& times() const { return times_; }

 private:
  using Clock = std::chrono::steady_clock;
  std::vector<std::pair<std::string, double>> times_;
  Clock::time_point last_;
};

}  // namespace hybrid_slam
