#pragma once

#include <cstdint>
#include <map>
#include <utility>

#include "apps/pipeline/slam_run.h"

namespace hybrid_slam {

// Keeps the books of a run: counts, records, progress. One thread.
class Recorder {
 public:
  Recorder(RunResult& result, const RunHooks& hooks, std::size_t total);

  void corrupt(const std::string& reason);
  void fisheye_missing(const std::string& reason);
  void failed(const std::optional<RunFailure>& failure);  // nothing to do if none
  void dropped(int count) { result_.frames.dropped += count; }
  void tracked(CameraKind camera, const TrackedFrame& frame, const MapSnapshot& map);
  void became_keyframe(CameraKind camera, std::int64_t frame_index, KeyframeId id);
  void frame_done();  // that was recorded last: what the process used since belongs to it
  bool cancelled();   // asked for? Then the result says so

 private:
  void warn(const std::string& text);
  void report();

  RunResult& result_;
  const RunHooks& hooks_;
  RunProgress progress_;
  double cpu_ms_;  // that the process had used when the last frame was done
  std::map<std::pair<CameraKind, std::int64_t>, std::size_t> record_of_frame_;
};

}  // namespace hybrid_slam
