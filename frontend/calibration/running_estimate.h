#pragma once

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
                  const std::optional<FoundParameter>& start = std::nullopt);

  // `systematic`: what may shift all measurements alike.
  void add(double value, double information, double systematic = 0);

  // What was measured so far may be off by as much besides: it weighs no more than that allows.
  void doubt(double sigma);

  double value_now() const { return state().value; }
  double in_use() const { return in_use_; }
  double sigma() const;

  // For the next run to begin with; none before anything is known.
  std::optional<FoundParameter> found() const;
  // Whether it began with something that turned out to be no longer so.
  bool contradicts_start() const { return contradicts_start_; }

 private:
  static constexpr double kMemory = 1000;  // measurements
  // Measurements, of which a scatter can be told: that of eight is good to a quarter.
  static constexpr std::size_t kFewest = 8;
  static constexpr double kAccident = 4.89;  // once in a million: standard deviations, two-sided

  FoundParameter state() const;
  FoundParameter own() const;
  bool is_contradicted() const;
  void forget_start();
  double scatter() const;

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
