#include "apps/slam/replay.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "apps/slam/recorder.h"
#include "backend/map/components.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

using Clock = std::chrono::steady_clock;

SessionObservers observers_of(Recorder& recorder) {
  SessionObservers observers;
  observers.frame = [&](const FrameResult& frame) { recorder.tracked(frame); };
  observers.keyframe = [&](const KeyframeResult& keyframe) { recorder.became_keyframe(keyframe); };
  observers.loop = [&](const LoopRecord& loop) { recorder.looped(loop); };
  observers.left_out = [&](const LeftOut& input) { recorder.left_out(input); };
  observers.failure = [&](const SessionFailure& failure) { recorder.failed(failure); };
  return observers;
}

// Waits until it is due. False if no further image shall come.
bool wait_until(Clock::time_point due, const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  wake.wait_until(lock, stop, due, [] { return false; });
  return !stop.stop_requested();
}

// All moments, one after the other; each when it is due, if there is a rate. Where reading cannot
// keep up with it, those that have been due for two periods are dropped unread.
void push_all(const FrameSource& source, std::size_t total, double rate,
              const std::stop_token& stop, Session& session, Recorder& recorder) {
  const auto start = Clock::now();
  for (std::size_t i = 0; i < total && !stop.stop_requested(); ++i) {
    const std::chrono::duration<double> age(rate > 0 ? static_cast<double>(i) / rate : 0);
    const auto due = start + std::chrono::duration_cast<Clock::duration>(age);
    if (rate > 0 && Clock::now() - due > std::chrono::duration<double>(2 / rate)) {
      recorder.dropped_unread(source.time(i));
      continue;
    }
    Moment moment = source.read(i);
    if (rate > 0 && !wait_until(due, stop)) return;
    if (!moment.error.empty()) recorder.corrupt(source.time(i), moment.error);
    if (!moment.fisheye_error.empty())
      recorder.fisheye_missing(source.time(i), moment.fisheye_error);
    for (SensorInput& input : moment.inputs) {
      if (session.push(std::move(input)) == PushResult::kClosed) return;
    }
  }
}

KeyframeId component_of(const RunResult& result, const FrameRecord& record) {
  const KeyframeId id = record.keyframe.value_or(record.frame.reference);
  return id.valid() ? result.map->component(id) : KeyframeId();
}

// Frames whose component is not the one that holds most of them have poses of another world.
void settle_components(RunResult& result) {
  result.components = component_sizes(*result.map).size();
  std::map<KeyframeId, int> frames;
  for (const FrameRecord& record : result.records) {
    if (record.frame.tracked()) ++frames[component_of(result, record)];
  }
  const auto most =
      std::max_element(frames.begin(), frames.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == frames.end()) return;
  const auto settle = [&](std::vector<FrameRecord>& records, FrameCounts& counts) {
    for (FrameRecord& record : records) {
      record.in_main = record.frame.tracked() && component_of(result, record) == most->first;
      if (!record.frame.tracked() || record.in_main) continue;
      --counts.tracked;
      ++counts.other_components;
    }
  };
  settle(result.records, result.frames);
  settle(result.fisheye_records, result.fisheye_frames);
}

}  // namespace

Moment ImageFrameSource::read(std::size_t index) const {
  Moment moment;
  try {
    FrameImages images = sequence_.read(index);
    const Nanoseconds time = to_nanoseconds(images.time);
    moment.inputs.push_back(StereoImages{time, std::move(images.left), std::move(images.right)});
    if (!images.fisheye.empty()) {
      moment.inputs.push_back(FisheyeImage{time, std::move(images.fisheye)});
    }
    moment.fisheye_error = std::move(images.fisheye_error);
  } catch (const InputError& error) {
    moment.error = error.what();
  }
  return moment;
}

RunResult replay(const FrameSource& source, const SlamOptions& options, ReplayOptions replay,
                 const ReplayHooks& hooks, Map map) {
  RunResult result;
  const std::size_t total = replay.moments_of(source.size());
  Recorder recorder(result, hooks, total);
  replay.session.drop = replay.rate > 0;
  Session session(source.cameras(), options, std::move(replay.session), observers_of(recorder),
                  std::move(map));
  {
    const std::stop_callback cancel(hooks.cancelled, [&] { session.cancel(); });
    push_all(source, total, replay.rate, hooks.cancelled, session, recorder);
    session.finish();
  }
  recorder.finish(session.counts(), hooks.cancelled.stop_requested());
  result.map = session.map();
  settle_components(result);
  result.times = session.times();
  result.upsampling = session.upsampling();
  result.upsampled = session.upsamples();
  result.file_info = session.file_info();
  return result;
}

}  // namespace hybrid_slam
