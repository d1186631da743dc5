#pragma once

#include <algorithm>
#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace hybrid_slam {

// How long each run of each stage took. One owner; the workers' are merged at the end.
class StageTimes {
 public:
  void add(std::string_view stage, double milliseconds) {
    durations(stage).push_back(milliseconds);
  }

  void merge(const StageTimes& other) {
    for (const auto& [stage, theirs] : other.stages_) {
      auto& mine = durations(stage);
      mine.insert(mine.end(), theirs.begin(), theirs.end());
    }
  }

  // Stages in the order in which they were first added, with every duration [ms].
  const std::vector<std::pair<std::string, std::vector<double>>>& stages() const { return stages_; }

 private:
  std::vector<double>& durations(std::string_view stage) {
    const auto same = [&](const auto& entry) { return entry.first == stage; };
    const auto entry = std::find_if(stages_.begin(), stages_.end(), same);
    if (entry != stages_.end()) {
      return entry->second;
    }
    return stages_.emplace_back(stage, std::vector<double>()).second;
  }

  std::vector<std::pair<std::string, std::vector<double>>> stages_;
};

// Times consecutive stages of one piece of work.
class StageClock {
 public:
  explicit StageClock(StageTimes& times) : times_(times) {}

  // The time since the last lap, or since construction, belongs to `stage`.
  void lap(std::string_view stage) {
    const auto now = std::chrono::steady_clock::now();
    times_.add(stage, std::chrono::duration<double, std::milli>(now - start_).count());
    start_ = now;
  }

 private:
  StageTimes& times_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace hybrid_slam
