#include "apps/slam/recorder.h"

#include <time.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace hybrid_slam {
namespace {

constexpr const char* kCorrupt = "corrupt";

RecordedFrame recorded(const TrackedFrame& frame) {
  return {frame.frame_index, frame.time,   frame.cam_from_reference,
          frame.reference,   frame.source, frame.prediction};
}

double process_cpu_ms() {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return 1e3 * static_cast<double>(used.tv_sec) + 1e-6 * static_cast<double>(used.tv_nsec);
}

}  // namespace

Rigid3d RunResult::cam_from_world(const FrameRecord& record) const {
  if (record.keyframe) return map->cam_from_world(*record.keyframe);
  return record.frame.cam_from_reference * map->cam_from_world(record.frame.reference);
}

Recorder::Recorder(RunResult& result, const ReplayHooks& hooks, std::size_t total)
    : result_(result), hooks_(hooks), cpu_ms_(process_cpu_ms()) {
  progress_.total = total;
}

void Recorder::due(Nanoseconds time, std::chrono::steady_clock::time_point moment) {
  const std::lock_guard lock(mutex_);
  due_[time] = moment;
}

void Recorder::corrupt(Nanoseconds time, const std::string& reason) {
  const std::lock_guard lock(mutex_);
  ++result_.frames.read;
  ++result_.frames.corrupt;
  warn(reason);
  tell_left_out({CameraKind::kStereo, time, kCorrupt});
  report();
}

void Recorder::fisheye_missing(Nanoseconds time, const std::string& reason) {
  const std::lock_guard lock(mutex_);
  ++result_.fisheye_frames.read;
  ++result_.fisheye_frames.corrupt;
  warn(reason);
  tell_left_out({CameraKind::kFisheye, time, kCorrupt});
}

void Recorder::dropped_unread(Nanoseconds time) {
  const std::lock_guard lock(mutex_);
  ++result_.frames.dropped;
  tell_left_out({CameraKind::kStereo, time, kDropped});
}

void Recorder::left_out(const LeftOut& input) {
  const std::lock_guard lock(mutex_);
  tell_left_out(input);
}

void Recorder::tell_left_out(const LeftOut& input) {
  if (hooks_.left_out) hooks_.left_out(input);
}

void Recorder::failed(const SessionFailure& failure) {
  const std::lock_guard lock(mutex_);
  warn(failure.text);
  if (failure.internal) result_.internal_errors.push_back(failure.text);
}

void Recorder::warn(const std::string& text) {
  if (hooks_.warning) hooks_.warning(text);
}

void Recorder::tracked(const FrameResult& frame) {
  const std::lock_guard lock(mutex_);
  const bool stereo = frame.camera == CameraKind::kStereo;
  FrameCounts& counts = stereo ? result_.frames : result_.fisheye_frames;
  auto& records = stereo ? result_.records : result_.fisheye_records;
  ++counts.read;
  ++(frame.has_pose() ? counts.tracked : frame.tracked.coasted() ? counts.coasted : counts.lost);
  records.push_back({recorded(frame.tracked), std::nullopt});
  FrameConditions& conditions = stereo ? result_.conditions : result_.fisheye_conditions;
  ++conditions.states[to_string(frame.state)];
  for (const FoundCause& found : frame.causes) ++conditions.causes[to_string(found.cause)];
  if (frame.rig) result_.rig = frame.rig;
  if (hooks_.frame) hooks_.frame(frame);
  progress_.keyframes = frame.keyframes;
  progress_.landmarks = frame.landmarks;
  if (!stereo) return;
  result_.disparity_offset = frame.tracked.disparity_offset;
  result_.shading = frame.tracked.shading;
  begin_times(frame);
  report();
}

void Recorder::became_keyframe(const KeyframeResult& keyframe) {
  const std::lock_guard lock(mutex_);
  auto& records =
      keyframe.camera == CameraKind::kStereo ? result_.records : result_.fisheye_records;
  const auto record = std::find_if(records.rbegin(), records.rend(), [&](const FrameRecord& one) {
    return one.frame.frame_index == keyframe.index;
  });
  if (record != records.rend()) record->keyframe = keyframe.id;
}

void Recorder::looped(const LoopRecord& loop) {
  const std::lock_guard lock(mutex_);
  result_.loops.push_back(loop);
}

// Those of the frame before are complete.
void Recorder::begin_times(const FrameResult& frame) {
  const double cpu_ms = cpu_time_since();
  if (times_ && hooks_.times) hooks_.times(*times_);
  times_ = FrameTimes{frame.tracked.time, cpu_ms, time_behind(frame.time)};
}

void Recorder::end_times() {
  if (!times_) return;
  times_->cpu_ms += cpu_time_since();
  if (hooks_.times) hooks_.times(*times_);
  times_.reset();
}

double Recorder::cpu_time_since() {
  const double now = process_cpu_ms();
  return now - std::exchange(cpu_ms_, now);
}

// Those before it were left out.
std::optional<double> Recorder::time_behind(Nanoseconds time) {
  const auto found = due_.find(time);
  if (found == due_.end()) return std::nullopt;
  const std::chrono::duration<double, std::milli> behind =
      std::chrono::steady_clock::now() - found->second;
  due_.erase(due_.begin(), std::next(found));
  return behind.count();
}

void Recorder::finish(const SessionCounts& counts, bool cancelled) {
  const std::lock_guard lock(mutex_);
  result_.frames.dropped += static_cast<int>(counts.stereo.dropped);
  result_.fisheye_frames.dropped = static_cast<int>(counts.fisheye.dropped);
  result_.cancelled = cancelled;
  if (counts.overruns > 0) {  // a terminal that stands still, say
    warn(std::to_string(counts.overruns) +
         " events came too fast to be recorded: frames are missing");
  }
  end_times();
}

void Recorder::report() {
  if (!hooks_.progress) return;
  progress_.frames = result_.frames;
  progress_.done = static_cast<std::size_t>(result_.frames.read);
  hooks_.progress(progress_);
}

}  // namespace hybrid_slam
