#include "apps/pipeline/checkpoint_worker.h"
#include "apps/pipeline/frame_tracking.h"

namespace hybrid_slam {

RunResult run_every_frame(const FrameSource& source, const SlamOptions& options,
                          const RunOptions& run, const RunHooks& hooks, Map map) {
  RunResult result;
  const std::size_t total = run.frames_of(source.size());
  Recorder recorder(result, hooks, total);
  LocalMapping mapping(options, std::move(map));
  FrameTracking tracking(source, options, run, mapping, recorder, result.times);
  CheckpointSchedule checkpoints(run.checkpoint_every);
  std::optional<LoopClosing> loops;
  if (options.loops.enabled && !run.localize) {
    loops.emplace(tracking.places(), options.loops.finder);
  }
  const auto publish = [&] { result.map = mapping.snapshot(); };
  const auto close_loop = [&](KeyframeId id) {
    const auto loop = loops ? loops->find(*result.map, id, result.times) : std::nullopt;
    if (!loop) {
      return;
    }
    const LoopOutcome outcome = mapping.close(*loop, result.times, publish);
    loops->closed(outcome);
    if (outcome.end == LoopEnd::kClosed) {
      mapping.adjust_full(result.times, publish);
    }
  };
  const auto add_keyframe = [&](const std::optional<MappingJob>& job) {
    if (!job) {
      return;
    }
    const KeyframeId id = mapping.process(*job, result.times, {}, publish);
    recorder.became_keyframe(job->camera, job->frame_index(), id);
    close_loop(id);
    if (checkpoints.due()) {
      recorder.failed(save_checkpoint(hooks.checkpoint, *result.map, result.times));
    }
  };
  publish();

  OrderedLoader loader(source, run.threads, indices_below(total));
  while (auto frames = tracking.next(loader)) {
    add_keyframe(tracking.track(std::move(frames->stereo), *result.map));
    add_keyframe(tracking.track_fisheye(std::move(*frames), *result.map));
  }
  loader.stop();
  loader.join();
  result.times.merge(loader.times());
  if (loops) {
    result.loops = loops->records();
  }
  return result;
}

}  // namespace hybrid_slam
