#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include "apps/pipeline/channel.h"
#include "apps/pipeline/checkpoint_worker.h"
#include "apps/pipeline/frame_tracking.h"
#include "apps/pipeline/paced_camera.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kMappingBacklog = 3;  // keyframes waiting for local mapping

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
  void wait_for_map(std::size_t version) const { snapshots_.next(version); }
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
  struct Added {
    CameraKind camera;
    std::int64_t frame_index;
    KeyframeId id;
  };
  const std::vector<Added>& keyframes() const { return keyframes_; }

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
        const KeyframeId id = mapping_.process(*job, times_, stop.get_token(), publish);
        keyframes_.push_back({job->camera, job->frame_index(), id});
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
  std::stop_source current_;      // guarded by mutex_
  StageTimes times_;              // the thread's own until finish()
  std::vector<Added> keyframes_;  // likewise
  std::exception_ptr failure_;    // likewise
  std::jthread thread_;
};

void report_failures(CheckpointWorker& checkpoints, Recorder& recorder) {
  for (const RunFailure& failure : checkpoints.take_failures()) {
    recorder.failed(failure);
  }
}

// Hands a keyframe to mapping. Where time presses, the one before is cut short. The first one
// starts the map, without which there is nothing to track against. False if the worker has failed.
bool add_keyframe(std::optional<MappingJob> job, MappingWorker& mapping, bool paced) {
  if (!job) {
    return true;
  }
  if (paced) {
    mapping.hurry();
  }
  const bool first = !mapping.snapshot()->origin().valid();
  const std::size_t version = mapping.version();
  if (!mapping.add(std::move(*job))) {
    return false;
  }
  if (first) {
    mapping.wait_for_map(version);
  }
  return true;
}

// Tracks in the calling thread until the images end or the run is cancelled. Images that come at
// their own pace press for time; others wait for tracking, which waits for mapping, so that it is
// never more than one keyframe of each camera ahead.
void track_all(OrderedLoader& loader, FrameTracking& tracking, MappingWorker& mapping,
               CheckpointWorker& checkpoints, bool paced, Recorder& recorder) {
  while (auto frames = tracking.next(loader)) {
    report_failures(checkpoints, recorder);
    if (!paced) {
      mapping.wait_until_taken();
    }
    auto job = tracking.track(std::move(frames->stereo), *mapping.snapshot(), mapping.has_room());
    if (!add_keyframe(std::move(job), mapping, paced)) {
      break;
    }
    job = tracking.track_fisheye(std::move(*frames), *mapping.snapshot(), mapping.has_room());
    if (!add_keyframe(std::move(job), mapping, paced)) {
      break;
    }
  }
}

}  // namespace

RunResult run_realtime(const FrameSource& source, const SlamOptions& options, const RunOptions& run,
                       const RunHooks& hooks) {
  RunResult result;
  const std::size_t total = run.frames_of(source.size());
  Recorder recorder(result, hooks, total);
  LocalMapping local_mapping(options);
  FrameTracking tracking(source, options, run.vocabulary, local_mapping, recorder, result.times);
  CheckpointWorker checkpoints(hooks.checkpoint, run.checkpoint_every);
  MappingWorker mapping(local_mapping, checkpoints);
  std::optional<PacedCamera> camera;
  if (run.rate > 0) {
    camera.emplace(total, run.rate, hooks.cancelled);
  }
  OrderedLoader loader(source, run.threads,
                       camera ? [&] { return camera->next(); } : indices_below(total));
  try {
    track_all(loader, tracking, mapping, checkpoints, camera.has_value(), recorder);
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
  report_failures(checkpoints, recorder);
  for (const auto& [kind, frame, id] : mapping.keyframes()) {
    recorder.became_keyframe(kind, frame, id);
  }
  result.times.merge(loader.times());
  result.times.merge(mapping.times());
  result.times.merge(checkpoints.times());
  result.map = local_mapping.snapshot();
  return result;
}

}  // namespace hybrid_slam
