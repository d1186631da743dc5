#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace hybrid_slam {

// Durations [ms] of the stages of a run, sample by sample. Not thread-safe: one per thread, merged
// at the end.
class StageTimes {
 public:
  void add(const std::string& stage, double milliseconds) {
    samples_[stage].push_back(milliseconds);
  }

  void merge(const StageTimes& other) {
    for (const auto& [stage, samples] : other.samples_) {
      auto& mine = samples_[stage];
      mine.insert(mine.end(), samples.begin(), samples.end());
    }
  }

  const std::map<std::string, std::vector<double>>& samples() const { return samples_; }

 private:
  std::map<std::string, std::vector<double>> samples_;
};

// Times consecutive stages of one piece of work.
class StageClock {
 public:
  explicit StageClock(StageTimes& times) : times_(times) {}

  // The time since the last lap, or since construction, belongs to `stage`.
  void lap(const std::string& stage) {
    const auto now = std::chrono::steady_clock::now();
    times_.add(stage, std::chrono::duration<double, std::milli>(now - start_).count());
    start_ = now;
  }

 private:
  StageTimes& times_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace hybrid_slam
