#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "backend/map/rig_correction.h"

namespace hybrid_slam {

// The weighted mean of one parameter's measurements, and how far it may be off: by their weights,
// or by how much they scatter where that is more than the weights say. What is in use of it changes
// at stated numbers of measurements alone, each time these have doubled, so that a map is made with
// few values; and only where it is shown, else it is 0. Forgets slowly: rigs change.
//
// It may begin with what an earlier run has found, which then is in use from the first frame on and
// weighs as much as it is certain. Where this run's own measurements contradict that, they win: the
// rig is another one now.
class RunningEstimate {
 public:
  // `share`: of a measurement's information that is its own, where measurements have noise in
  // common. `min_significance`: standard deviations from 0 before it is used. `start`: of an
  // earlier run, in the place of the prior.
  RunningEstimate(double prior_sigma, double share, double min_significance,
                  const std::optional<FoundParameter>& start = std::nullopt)
      : share_(share),
        min_significance_(min_significance),
        prior_information_(1 / (prior_sigma * prior_sigma)),
        information_(start ? 0 : prior_information_),
        start_(start),
        start_information_(start ? 1 / (start->sigma * start->sigma) : 0),
        in_use_(start ? start->in_use : 0) {}

  // `systematic`: what may shift all measurements alike.
  void add(double value, double information, double systematic = 0) {
    const double kept = 1 - 1 / kMemory;
    const double added = share_ * information;
    information_ = kept * information_ + added;
    weighted_ = kept * weighted_ + added * value;
    squares_ = kept * squares_ + added * value * value;
    systematic_ = kept * systematic_ + added * systematic;
    count_ = kept * count_ + 1;
    start_information_ *= kept;
    if (++measurements_ < next_) return;
    next_ *= 2;
    if (start_ && measurements_ >= kFewest && is_contradicted()) forget_start();
    const FoundParameter now = state();
    const double sigma = std::hypot(now.sigma, now.systematic);
    in_use_ = std::abs(now.value) > min_significance_ * sigma ? now.value : 0;
  }

  double value_now() const { return state().value; }
  double in_use() const { return in_use_; }
  double sigma() const {
    const FoundParameter now = state();
    return std::hypot(now.sigma, now.systematic);
  }

  // For the next run to begin with; none before anything is known.
  std::optional<FoundParameter> found() const {
    return start_ || measurements_ > 0 ? std::optional(state()) : std::nullopt;
  }
  // Whether it began with something that turned out to be no longer so.
  bool contradicts_start() const { return contradicts_start_; }

 private:
  static constexpr double kMemory = 1000;  // measurements
  // Measurements, of which a scatter can be told: that of eight is good to a quarter.
  static constexpr std::size_t kFewest = 8;
  static constexpr double kAccident = 4.89;  // once in a million: standard deviations, two-sided

  FoundParameter state() const {
    if (!start_) return own();
    if (information_ == 0) return *start_;
    const FoundParameter mine = own();
    const double weight = 1 / (mine.sigma * mine.sigma);
    const double sum = weight + start_information_;
    return {(weight * mine.value + start_information_ * start_->value) / sum, 1 / std::sqrt(sum),
            (weight * mine.systematic + start_information_ * start_->systematic) / sum, in_use_};
  }

  // By this run's measurements alone, and the prior if there was no start.
  FoundParameter own() const {
    return {weighted_ / information_, std::sqrt(scatter() / information_),
            systematic_ / information_, in_use_};
  }

  bool is_contradicted() const {
    const FoundParameter mine = own();
    const double sigma = std::hypot(std::hypot(mine.sigma, mine.systematic),
                                    std::hypot(start_->sigma, start_->systematic));
    return std::abs(mine.value - start_->value) > kAccident * sigma;
  }

  void forget_start() {
    start_.reset();
    start_information_ = 0;
    information_ += prior_information_;
    contradicts_start_ = true;
  }

  // Mean square of the deviations from the mean, over what the weights promise; 1 or more.
  double scatter() const {
    const double deviations = squares_ - weighted_ * weighted_ / information_;
    return count_ > 2 ? std::max(1.0, deviations / (share_ * (count_ - 1))) : 1;
  }

  double share_;
  double min_significance_;
  double prior_information_;
  double information_;
  double weighted_ = 0;    // information x value
  double squares_ = 0;     // information x value^2
  double systematic_ = 0;  // information x systematic
  double count_ = 0;       // of what is not forgotten
  std::optional<FoundParameter> start_;
  double start_information_;  // that is not forgotten
  std::size_t measurements_ = 0;
  std::size_t next_ = 1;
  double in_use_;
  bool contradicts_start_ = false;
};

}  // namespace hybrid_slam
