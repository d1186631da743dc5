#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "apps/slam/inputs.h"

namespace hybrid_slam {

// What became of an input that was handed over.
enum class PushResult {
  kTaken,
  kLate,       // frames of later times have been released; left out
  kDuplicate,  // there is one of this camera and time already; left out
  kWrongSize,  // an image, or its mask, is not of the calibrated size; left out
  kNoCamera,   // of a fisheye, where there is none; left out
  kClosed,     // the session has finished, or was cancelled; left out
};

const char* to_string(PushResult result);

struct ReorderOptions {
  // By so much an input may come later than others of a later time.
  Nanoseconds window = 50'000'000;
  // Whether inputs are released as soon as every camera has passed their time, or waited for long
  // enough by the clock of the host. Otherwise always after the window, in the sensors' time: the
  // same inputs then come out in the same way however they are shuffled within it.
  bool early = true;
};

// Puts inputs in order by time, a stereo pair before the fisheye's image of the same time. No
// threads: the caller locks.
class ReorderBuffer {
 public:
  using Clock = std::chrono::steady_clock;

  // `fisheye`: whether there is one to wait for.
  ReorderBuffer(const ReorderOptions& options, bool fisheye)
      : options_(options), fisheye_(fisheye) {}

  // `arrival`: now, by the host's clock.
  PushResult add(SensorInput input, Clock::time_point arrival);

  // The earliest input, if it is due: at `now`, or in any case if `flush`.
  std::optional<SensorInput> take(Clock::time_point now, bool flush = false);

  // When the earliest input will be due by the clock alone; none if it is not waiting for that.
  std::optional<Clock::time_point> next_due() const;

  std::size_t size() const { return waiting_.size(); }

 private:
  using Key = std::pair<Nanoseconds, CameraKind>;
  struct Waiting {
    SensorInput input;
    Clock::time_point arrival;
  };

  bool begins_anew(Nanoseconds time);
  bool is_due(const Key& key, const Waiting& waiting, Clock::time_point now) const;

  ReorderOptions options_;
  bool fisheye_;
  std::map<Key, Waiting> waiting_;
  std::optional<Key> released_;               // the newest
  std::map<CameraKind, Nanoseconds> newest_;  // added, of each camera
  int far_behind_ = 0;  // inputs in a row that were late by more than any delay
};

}  // namespace hybrid_slam
