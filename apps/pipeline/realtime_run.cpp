#include <memory>
#include <optional>
#include <utility>

#include "apps/pipeline/checkpoint_worker.h"
#include "apps/pipeline/frame_tracking.h"
#include "apps/pipeline/full_bundle_worker.h"
#include "apps/pipeline/loop_worker.h"
#include "apps/pipeline/mapping_worker.h"
#include "apps/pipeline/paced_camera.h"

namespace hybrid_slam {
namespace {

// The threads behind tracking: mapping, the search for loops, full bundle adjustment, checkpoints.
class Workers {
 public:
  Workers(LocalMapping& mapping, const SlamOptions& options, const RunOptions& run,
          const SaveMap& checkpoint)
      : local_mapping_(mapping),
        checkpoints_(checkpoint, run.checkpoint_every),
        mapping_(mapping, events()) {
    if (options.loops.enabled && !run.localize) {
      // Its own: tracking has another, in another thread.
      loop_closing_.emplace(std::make_shared<KeyframeDatabase>(run.vocabulary),
                            options.loops.finder);
      loops_.emplace(*loop_closing_, mapping_);
      full_bundle_.emplace(options.backend.full, mapping_);
    }
  }
  ~Workers() { join(true); }

  MappingWorker& mapping() { return mapping_; }
  CheckpointWorker& checkpoints() { return checkpoints_; }

  // Joins the threads, then does in order what they left. `cancelled`: as little as possible.
  void finish(bool cancelled, Recorder& recorder) {
    join(cancelled);
    mapping_.rethrow();
    for (const auto& [kind, frame, id] : mapping_.keyframes()) {
      recorder.became_keyframe(kind, frame, id);
    }
    if (loops_) {
      recorder.failed(failure(loops_->failure()));
      recorder.failed(failure(full_bundle_->failure()));
      if (!cancelled) {
        close_left_loops();
      }
    }
  }

  // After finish().
  void write_to(RunResult& result) const {
    result.times.merge(mapping_.times());
    if (loops_) {
      result.times.merge(loops_->times());
      result.times.merge(full_bundle_->times());
      result.loops = loop_closing_->records();
    }
    result.times.merge(checkpoints_.times());
    result.times.merge(times_);
  }

 private:
  // Mapping first: the others learn that it takes nothing any more, and it tells them nothing.
  void join(bool give_up) {
    mapping_.finish();
    if (loops_) {
      loops_->finish();
      full_bundle_->finish(give_up);
    }
    checkpoints_.finish();
  }

  MappingEvents events() {
    MappingEvents events;
    events.mapped = [this](KeyframeId id, const std::shared_ptr<const MapSnapshot>& map) {
      checkpoints_.keyframe_added(map);
      if (loops_) {
        loops_->keyframe_mapped(id);
      }
    };
    events.looped = [this](const LoopOutcome& outcome,
                           const std::shared_ptr<const MapSnapshot>& map,
                           std::size_t loops_closed) {
      loops_->loop_handled(outcome);
      if (outcome.end == LoopEnd::kClosed) {
        full_bundle_->adjust(map, loops_closed);
      }
    };
    return events;
  }

  static std::optional<RunFailure> failure(const std::string& text) {
    return text.empty() ? std::nullopt : std::optional(RunFailure{text, true});
  }

  void close_left_loops() {
    const auto close = [&](const LoopMeasurement& loop) {
      loop_closing_->closed(local_mapping_.close(loop, times_, [] {}));
    };
    if (const auto loop = loops_->take_loop()) {
      close(*loop);
    }
    for (const KeyframeId id : loops_->take_keyframes()) {
      if (const auto loop = loop_closing_->find(*local_mapping_.snapshot(), id, times_)) {
        close(*loop);
      }
    }
    std::size_t adjusted = mapping_.loops_adjusted();
    if (auto correction = full_bundle_->take_correction()) {
      adjusted = correction->loops_closed;
      local_mapping_.take_in_full(std::move(correction->result), adjusted, times_, [] {});
    }
    if (local_mapping_.closings() > adjusted) {
      local_mapping_.adjust_full(times_, [] {});
    }
  }

  LocalMapping& local_mapping_;
  CheckpointWorker checkpoints_;
  std::optional<LoopClosing> loop_closing_;
  MappingWorker mapping_;
  std::optional<LoopWorker> loops_;
  std::optional<FullBundleWorker> full_bundle_;
  StageTimes times_;  // of what was left
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
// their own pace press for time: tracking waits for nobody. Others wait for tracking, which waits
// for mapping, so that it is never more than one keyframe of each camera ahead.
void track_all(OrderedLoader& loader, FrameTracking& tracking, Workers& workers, bool paced,
               Recorder& recorder) {
  MappingWorker& mapping = workers.mapping();
  while (auto frames = tracking.next(loader)) {
    report_failures(workers.checkpoints(), recorder);
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
                       const RunHooks& hooks, Map map) {
  RunResult result;
  const std::size_t total = run.frames_of(source.size());
  Recorder recorder(result, hooks, total);
  LocalMapping local_mapping(options, std::move(map));
  FrameTracking tracking(source, options, run, local_mapping, recorder, result.times);
  Workers workers(local_mapping, options, run, hooks.checkpoint);
  std::optional<PacedCamera> camera;
  if (run.rate > 0) {
    camera.emplace(total, run.rate, hooks.cancelled);
  }
  OrderedLoader loader(source, run.threads,
                       camera ? [&] { return camera->next(); } : indices_below(total));
  try {
    track_all(loader, tracking, workers, camera.has_value(), recorder);
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
  workers.finish(recorder.cancelled(), recorder);
  report_failures(workers.checkpoints(), recorder);
  result.times.merge(loader.times());
  workers.write_to(result);
  result.map = local_mapping.snapshot();
  return result;
}

}  // namespace hybrid_slam
