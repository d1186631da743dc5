#include "frontend/calibration/running_estimate.h"

#include <algorithm>
#include <cmath>

namespace hybrid_slam {

RunningEstimate::RunningEstimate(double prior_sigma, double share, double min_significance,
                                 const std::optional<FoundParameter>& start)
    : share_(share),
      min_significance_(min_significance),
      prior_information_(1 / (prior_sigma * prior_sigma)),
      information_(start ? 0 : prior_information_),
      start_(start),
      start_information_(start ? 1 / (start->sigma * start->sigma) : 0),
      in_use_(start ? start->in_use : 0) {}

void RunningEstimate::add(double value, double information, double systematic) {
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

void RunningEstimate::doubt(double sigma) {
  const double kept = std::min(1.0, scatter() / (sigma * sigma * information_));
  for (double* sum : {&information_, &weighted_, &squares_, &systematic_, &count_}) *sum *= kept;
}

double RunningEstimate::sigma() const {
  const FoundParameter now = state();
  return std::hypot(now.sigma, now.systematic);
}

std::optional<FoundParameter> RunningEstimate::found() const {
  return start_ || measurements_ > 0 ? std::optional(state()) : std::nullopt;
}

FoundParameter RunningEstimate::state() const {
  if (!start_) return own();
  if (information_ == 0) return *start_;
  const FoundParameter mine = own();
  const double weight = 1 / (mine.sigma * mine.sigma);
  const double sum = weight + start_information_;
  return {(weight * mine.value + start_information_ * start_->value) / sum, 1 / std::sqrt(sum),
          (weight * mine.systematic + start_information_ * start_->systematic) / sum, in_use_};
}

// By this run's measurements alone, and the prior if there was no start.
FoundParameter RunningEstimate::own() const {
  return {weighted_ / information_, std::sqrt(scatter() / information_), systematic_ / information_,
          in_use_};
}

bool RunningEstimate::is_contradicted() const {
  const FoundParameter mine = own();
  const double sigma = std::hypot(std::hypot(mine.sigma, mine.systematic),
                                  std::hypot(start_->sigma, start_->systematic));
  return std::abs(mine.value - start_->value) > kAccident * sigma;
}

void RunningEstimate::forget_start() {
  start_.reset();
  start_information_ = 0;
  information_ += prior_information_;
  contradicts_start_ = true;
}

// Mean square of the deviations from the mean, over what the weights promise; 1 or more.
double RunningEstimate::scatter() const {
  const double deviations = squares_ - weighted_ * weighted_ / information_;
  return count_ > 2 ? std::max(1.0, deviations / (share_ * (count_ - 1))) : 1;
}

}  // namespace hybrid_slam
