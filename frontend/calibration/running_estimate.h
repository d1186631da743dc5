#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace hybrid_slam {

// The weighted mean of one parameter's measurements, and how far it may be off: by their weights,
// or by how much they scatter where that is more than the weights say. What is in use of it changes
// at stated numbers of measurements alone, each time these have doubled, so that a map is made with
// few values; and only where it is shown, else it is 0. Forgets slowly: rigs change.
class RunningEstimate {
 public:
  // `share`: of a measurement's information that is its own, where measurements have noise in
  // common. `min_significance`: standard deviations from 0 before it is used.
  RunningEstimate(double prior_sigma, double share, double min_significance)
      : share_(share),
        min_significance_(min_significance),
        information_(1 / (prior_sigma * prior_sigma)) {}

  // `systematic`: what may shift all measurements alike.
  void add(double value, double information, double systematic = 0) {
    const double kept = 1 - 1 / kMemory;
    const double added = share_ * information;
    information_ = kept * information_ + added;
    weighted_ = kept * weighted_ + added * value;
    squares_ = kept * squares_ + added * value * value;
    systematic_ = kept * systematic_ + added * systematic;
    count_ = kept * count_ + 1;
    if (++measurements_ < next_) return;
    next_ *= 2;
    in_use_ = std::abs(value_now()) > min_significance_ * sigma() ? value_now() : 0;
  }

  double value_now() const { return weighted_ / information_; }
  double in_use() const { return in_use_; }
  double sigma() const {
    return std::hypot(std::sqrt(scatter() / information_), systematic_ / information_);
  }

 private:
  static constexpr double kMemory = 1000;  // measurements

  // Mean square of the deviations from the mean, over what the weights promise; 1 or more.
  double scatter() const {
    const double deviations = squares_ - weighted_ * weighted_ / information_;
    return count_ > 2 ? std::max(1.0, deviations / (share_ * (count_ - 1))) : 1;
  }

  double share_;
  double min_significance_;
  double information_;
  double weighted_ = 0;    // information x value
  double squares_ = 0;     // information x value^2
  double systematic_ = 0;  // information x systematic
  double count_ = 0;       // of what is not forgotten
  std::size_t measurements_ = 0;
  std::size_t next_ = 1;
  double in_use_ = 0;
};

}  // namespace hybrid_slam
