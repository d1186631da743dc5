#include "apps/slam/replay.h"

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "apps/slam/recorded_run.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

using Clock = std::chrono::steady_clock;

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
void push_all(const FrameSource& source, std::size_t total, double rate, const ReplayHooks& hooks,
              Session& session, Recorder& recorder) {
  const std::stop_token& stop = hooks.cancelled;
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
    if (hooks.images) hooks.images(moment);
    if (rate > 0) recorder.due(source.time(i), due);
    for (SensorInput& input : moment.inputs) {
      if (session.push(std::move(input)) == PushResult::kClosed) return;
    }
  }
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
  const std::size_t total = replay.moments_of(source.size());
  replay.session.drop = replay.rate > 0;
  return recorded_run(source.cameras(), options, std::move(replay.session), hooks, std::move(map),
                      total, [&](Session& session, Recorder& recorder) {
                        push_all(source, total, replay.rate, hooks, session, recorder);
                      });
}

}  // namespace hybrid_slam
