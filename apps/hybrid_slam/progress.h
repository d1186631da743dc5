#pragma once

#include <chrono>

#include "apps/pipeline/slam_run.h"

namespace hybrid_slam {

// One line that is written over on a terminal, a plain line now and then elsewhere. To stderr.
class ProgressPrinter {
 public:
  explicit ProgressPrinter(bool quiet);

  void operator()(const RunProgress& progress);
  void finish();  // ends the line on a terminal

 private:
  using Clock = std::chrono::steady_clock;

  bool quiet_;
  bool terminal_;
  bool open_line_ = false;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace hybrid_slam
