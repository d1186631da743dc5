#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace hybrid_slam {

// How far a program is, to stderr: one line that is written over on a terminal, a plain line now
// and then elsewhere. "<done>/<total> <unit>  <rate>/s  <left> s left  <more>"; where nobody knows
// the total, it is 0, and "<done> <unit>  <rate>/s  <more>" is said.
class ProgressLine {
 public:
  // `quiet`: prints nothing.
  ProgressLine(std::string unit, bool quiet);

  // Prints if it is time to. `more`: whatever else there is to say.
  void update(std::size_t done, std::size_t total, const std::string& more);
  void finish();  // ends the line on a terminal

 private:
  using Clock = std::chrono::steady_clock;

  std::string unit_;
  bool quiet_;
  bool terminal_;
  bool open_line_ = false;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace hybrid_slam
