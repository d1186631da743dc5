#include "apps/pipeline/recorder.h"

#include <time.h>

namespace hybrid_slam {
namespace {

double process_cpu_ms() {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return 1e3 * static_cast<double>(used.tv_sec) + 1e-6 * static_cast<double>(used.tv_nsec);
}

}  // namespace

Recorder::Recorder(RunResult& result, const RunHooks& hooks, std::size_t total)
    : result_(result), hooks_(hooks), cpu_ms_(process_cpu_ms()) {
  progress_.total = total;
}

Rigid3d RunResult::cam_from_world(const FrameRecord& record) const {
  if (record.keyframe) {
    return map->cam_from_world(*record.keyframe);
  }
  return record.frame.cam_from_reference * map->cam_from_world(record.frame.reference);
}

void Recorder::corrupt(const std::string& reason) {
  ++result_.frames.read;
  ++result_.frames.corrupt;
  warn(reason);
  report();
}

void Recorder::fisheye_missing(const std::string& reason) {
  ++result_.fisheye_frames.read;
  ++result_.fisheye_frames.corrupt;
  warn(reason);
}

void Recorder::failed(const std::optional<RunFailure>& failure) {
  if (!failure) {
    return;
  }
  warn(failure->text);
  if (failure->internal) {
    result_.internal_errors.push_back(failure->text);
  }
}

void Recorder::warn(const std::string& text) {
  if (hooks_.warning) {
    hooks_.warning(text);
  }
}

void Recorder::tracked(CameraKind camera, const TrackedFrame& frame, const MapSnapshot& map) {
  const bool stereo = camera == CameraKind::kStereo;
  FrameCounts& counts = stereo ? result_.frames : result_.fisheye_frames;
  auto& records = stereo ? result_.records : result_.fisheye_records;
  ++counts.read;
  ++(frame.tracked() ? counts.tracked : counts.lost);
  record_of_frame_[{camera, frame.frame_index}] = records.size();
  FrameRecord record{frame, std::nullopt, 0};
  record.frame.keyframe.reset();
  record.frame.counts = {};
  records.push_back(std::move(record));
  progress_.keyframes = map.keyframe_count();
  progress_.landmarks = map.landmark_count();
  if (stereo) report();
}

void Recorder::became_keyframe(CameraKind camera, std::int64_t frame_index, KeyframeId id) {
  auto& records = camera == CameraKind::kStereo ? result_.records : result_.fisheye_records;
  records[record_of_frame_.at({camera, frame_index})].keyframe = id;
}

void Recorder::frame_done() {
  if (result_.records.empty()) return;
  const double now = process_cpu_ms();
  result_.records.back().cpu_ms += now - cpu_ms_;
  cpu_ms_ = now;
}

bool Recorder::cancelled() {
  result_.cancelled = result_.cancelled || hooks_.cancelled.stop_requested();
  return result_.cancelled;
}

void Recorder::report() {
  if (!hooks_.progress) {
    return;
  }
  progress_.frames = result_.frames;
  progress_.done = static_cast<std::size_t>(result_.frames.read) +
                   static_cast<std::size_t>(result_.frames.dropped);
  hooks_.progress(progress_);
}

}  // namespace hybrid_slam
