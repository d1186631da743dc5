#include <algorithm>
#include <chrono>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include "apps/pipeline/channel.h"
#include "apps/pipeline/checkpoint_worker.h"
#include "apps/pipeline/local_mapping.h"
#include "apps/pipeline/ordered_loader.h"
#include "apps/pipeline/recorder.h"
#include "apps/pipeline/slam_run.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kMappingBacklog = 3;  // keyframes waiting for local mapping
constexpr std::size_t kImageBacklog = 2;    // images waiting for the pipeline, with a rate

// Local mapping in its own thread. Keyframes go in, snapshots come out.
class MappingWorker {
 public:
  MappingWorker(LocalMapping& mapping, CheckpointWorker& checkpoints)
      : mapping_(mapping), checkpoints_(checkpoints), jobs_(kMappingBacklog) {
    snapshots_.publish(mapping_.snapshot());
    thread_ = std::jthread([this] { work(); });
  }

  ~MappingWorker() { finish(); }

  bool has_room() const { return jobs_.size() < kMappingBacklog; }

  // False if the worker has failed: see rethrow().
  bool add(MappingJob job) { return jobs_.push(std::move(job)); }

  // Where time presses, a keyframe is worth more than the last iterations of the one before: its
  // adjustment is cut short. Before the new one is added, so that it cannot be the one that is
  // stopped.
  void hurry() {
    const std::lock_guard lock(mutex_);
    current_.request_stop();
  }

  // Until the worker has begun with the last keyframe it was given.
  void wait_until_taken() { jobs_.wait_empty(); }

  std::shared_ptr<const MapSnapshot> snapshot() const { return snapshots_.get(); }

  // Until the map has begun, there is nothing to track against.
  void wait_for_map(std::size_t version) const { snapshots_.wait_beyond(version); }
  std::size_t version() const { return snapshots_.version(); }

  // What is queued is still mapped.
  void finish() {
    jobs_.close();
    if (thread_.joinable()) {
      thread_.join();
    }
  }

  // After finish(): what the thread threw, if it did.
  void rethrow() const {
    if (failure_) {
      std::rethrow_exception(failure_);
    }
  }

  // After finish().
  const StageTimes& times() const { return times_; }
  const std::vector<std::pair<std::int64_t, KeyframeId>>& keyframes() const { return keyframes_; }

 private:
  void work() {
    const auto publish = [this] { snapshots_.publish(mapping_.snapshot()); };
    try {
      while (auto job = jobs_.pop()) {
        std::stop_source stop;
        {
          const std::lock_guard lock(mutex_);
          current_ = stop;
        }
        const std::int64_t frame = job->keyframe.observations->frame_index;
        keyframes_.emplace_back(frame, mapping_.process(*job, times_, stop.get_token(), publish));
        checkpoints_.keyframe_added(snapshots_.get());
      }
    } catch (...) {
      failure_ = std::current_exception();
      jobs_.close();
    }
    snapshots_.close();
  }

  LocalMapping& mapping_;
  CheckpointWorker& checkpoints_;
  Channel<MappingJob> jobs_;
  Latest<MapSnapshot> snapshots_;
  std::mutex mutex_;
  std::stop_source current_;                                    // guarded by mutex_
  StageTimes times_;                                            // the thread's own until finish()
  std::vector<std::pair<std::int64_t, KeyframeId>> keyframes_;  // likewise
  std::exception_ptr failure_;                                  // likewise
  std::jthread thread_;
};

// Stands in for a live camera: hands out indices at a fixed rate and drops what nobody takes in
// time.
class PacedCamera {
 public:
  PacedCamera(std::size_t total, double rate) : indices_(kImageBacklog) {
    thread_ = std::jthread([this, total, rate](const std::stop_token& stop) {
      const auto start = std::chrono::steady_clock::now();
      for (std::size_t i = 0; i < total; ++i) {
        std::unique_lock lock(mutex_);
        const auto due = start + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                     std::chrono::duration<double>(static_cast<double>(i) / rate));
        if (wake_.wait_until(lock, stop, due, [] { return false; }) || stop.stop_requested()) {
          break;
        }
        dropped_ += indices_.try_push(i) ? 0 : 1;
      }
      indices_.close();
    });
  }

  std::optional<std::size_t> next() { return indices_.pop(); }

  // No further image; waits for the thread. Returns how many were dropped.
  int finish() {
    thread_.request_stop();
    if (thread_.joinable()) {
      thread_.join();
    }
    return dropped_;
  }

 private:
  Channel<std::size_t> indices_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  int dropped_ = 0;  // the thread's own until finish()
  std::jthread thread_;
};

// Tracks in the calling thread until the images end or the run is cancelled. Images that come at
// their own pace press for time; others wait for tracking, which waits for mapping, so that it is
// never more than one keyframe ahead.
void track_all(OrderedLoader& loader, StereoTracker& tracker, MappingWorker& mapping,
               CheckpointWorker& checkpoints, bool paced, Recorder& recorder, StageTimes& times) {
  MapEdit counts;
  while (!recorder.cancelled()) {
    recorder.warn(checkpoints.take_failures());
    auto loaded = loader.next();
    if (!loaded) {
      break;
    }
    if (!loaded->frame) {
      recorder.corrupt(loaded->error);
      continue;
    }
    if (!paced) {
      mapping.wait_until_taken();
    }
    const auto map = mapping.snapshot();
    StageClock clock(times);
    TrackedFrame tracked = tracker.track(std::move(*loaded->frame), *map, mapping.has_room());
    clock.lap("track");
    append_counts(tracked.counts, counts);
    recorder.tracked(tracked, *map);
    if (tracked.keyframe) {
      const std::size_t version = mapping.version();
      if (paced) {
        mapping.hurry();
      }
      if (!mapping.add({std::move(*tracked.keyframe), std::exchange(counts, {})})) {
        break;
      }
      if (tracked.source == PoseSource::kInitialization) {
        mapping.wait_for_map(version);
      }
    }
  }
}

}  // namespace

RunResult run_realtime(const FrameSource& source, const SlamOptions& options, const RunOptions& run,
                       const RunHooks& hooks) {
  RunResult result;
  const std::size_t total = run.limit > 0 ? std::min(run.limit, source.size()) : source.size();
  Recorder recorder(result, hooks, total);
  LocalMapping local_mapping(options);
  StereoTracker tracker(local_mapping.add_camera(source.camera()), source.camera(),
                        options.tracking);
  CheckpointWorker checkpoints(hooks.checkpoint, run.checkpoint_every);
  MappingWorker mapping(local_mapping, checkpoints);
  std::optional<PacedCamera> camera;
  if (run.rate > 0) {
    camera.emplace(total, run.rate);
  }
  OrderedLoader loader(source, run.threads,
                       [&, next = std::size_t{0}]() mutable -> std::optional<std::size_t> {
                         if (camera) {
                           return camera->next();
                         }
                         return next < total ? std::optional(next++) : std::nullopt;
                       });
  try {
    track_all(loader, tracker, mapping, checkpoints, camera.has_value(), recorder, result.times);
  } catch (...) {
    if (camera) {
      camera->finish();  // a loader may be waiting for it
    }
    throw;
  }
  if (camera) {
    recorder.dropped(camera->finish());
  }
  loader.stop();
  loader.join();
  mapping.finish();
  mapping.rethrow();
  checkpoints.finish();
  checkpoints.rethrow();
  recorder.warn(checkpoints.take_failures());
  for (const auto& [frame, id] : mapping.keyframes()) {
    recorder.became_keyframe(frame, id);
  }
  result.times.merge(loader.times());
  result.times.merge(mapping.times());
  result.times.merge(checkpoints.times());
  result.map = local_mapping.snapshot();
  return result;
}

}  // namespace hybrid_slam
