#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>

#include "apps/slam/replay.h"

namespace hybrid_slam {

// Keeps the books of a replay: counts, records, progress. Thread-safe.
class Recorder {
 public:
  Recorder(RunResult& result, const ReplayHooks& hooks, std::size_t total);

  // The stereo pair of `time` is due, as a camera gives it: how far behind it is tracked is counted
  // from here.
  void due(Nanoseconds time, std::chrono::steady_clock::time_point moment);
  void corrupt(Nanoseconds time, const std::string& reason);
  void fisheye_missing(Nanoseconds time, const std::string& reason);
  void dropped_unread(Nanoseconds time);
  void left_out(const LeftOut& input);
  void failed(const SessionFailure& failure);
  void tracked(const FrameResult& frame);
  void became_keyframe(const KeyframeResult& keyframe);
  void looped(const LoopRecord& loop);
  void finish(const SessionCounts& counts, bool cancelled);

 private:
  void warn(const std::string& text);
  void report();
  void begin_times(const FrameResult& frame);
  void end_times();
  double cpu_time_since();
  std::optional<double> time_behind(Nanoseconds time);
  void tell_left_out(const LeftOut& input);

  RunResult& result_;
  const ReplayHooks& hooks_;
  ReplayProgress progress_;
  double cpu_ms_;                    // that the process had used when the last frame was done
  std::optional<FrameTimes> times_;  // of the newest stereo frame
  std::map<Nanoseconds, std::chrono::steady_clock::time_point> due_;  // of pairs not yet tracked
  std::mutex mutex_;                                                  // guards all of it
};

}  // namespace hybrid_slam
