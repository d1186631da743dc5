#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace hybrid_slam {

// Durations of one stage [ms], however many there are: count, sum and maximum of all, and a sample
// in their order, evenly thinned out so that it stays bounded.
class Durations {
 public:
  static constexpr std::size_t kMostKept = 8192;

  void add(double milliseconds) {
    if (count_ % stride_ == 0) kept_.push_back(milliseconds);
    ++count_;
    sum_ += milliseconds;
    max_ = std::max(max_, milliseconds);
    if (kept_.size() > kMostKept) thin_out();
  }

  // Those of another worker follow.
  void merge(Durations other) {
    while (stride_ < other.stride_) thin_out();
    while (other.stride_ < stride_) other.thin_out();
    kept_.insert(kept_.end(), other.kept_.begin(), other.kept_.end());
    count_ += other.count_;
    sum_ += other.sum_;
    max_ = std::max(max_, other.max_);
    if (kept_.size() > kMostKept) thin_out();
  }

  std::size_t count() const { return count_; }
  double mean() const { return count_ == 0 ? 0 : sum_ / static_cast<double>(count_); }
  double max() const { return max_; }
  const std::vector<double>& kept() const { return kept_; }  // all, up to kMostKept

 private:
  // Every other one stays.
  void thin_out() {
    for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
    kept_.resize((kept_.size() + 1) / 2);
    stride_ *= 2;
  }

  std::vector<double> kept_;
  std::size_t stride_ = 1;  // one of so many is kept
  std::size_t count_ = 0;
  double sum_ = 0;
  double max_ = 0;
};

// How long each run of each stage took. One owner; the workers' are merged at the end.
class StageTimes {
 public:
  void add(std::string_view stage, double milliseconds) { durations(stage).add(milliseconds); }

  void merge(const StageTimes& other) {
    for (const auto& [stage, theirs] : other.stages_) durations(stage).merge(theirs);
  }

  // Stages in the order in which they were first added.
  const std::vector<std::pair<std::string, Durations>>& stages() const { return stages_; }

 private:
  Durations& durations(std::string_view stage) {
    const auto same = [&](const auto& entry) { return entry.first == stage; };
    const auto entry = std::find_if(stages_.begin(), stages_.end(), same);
    return entry != stages_.end() ? entry->second : stages_.emplace_back(stage, Durations()).second;
  }

  std::vector<std::pair<std::string, Durations>> stages_;
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
