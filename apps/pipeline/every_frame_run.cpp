#include "apps/pipeline/checkpoint_worker.h"
#include "apps/pipeline/frame_tracking.h"

namespace hybrid_slam {

RunResult run_every_frame(const FrameSource& source, const SlamOptions& options,
                          const RunOptions& run, const RunHooks& hooks) {
  RunResult result;
  const std::size_t total = run.frames_of(source.size());
  Recorder recorder(result, hooks, total);
  LocalMapping mapping(options);
  FrameTracking tracking(source, options, run.vocabulary, mapping, recorder, result.times);
  CheckpointSchedule checkpoints(run.checkpoint_every);
  const auto publish = [&] { result.map = mapping.snapshot(); };
  const auto add_keyframe = [&](const std::optional<MappingJob>& job) {
    if (!job) {
      return;
    }
    recorder.became_keyframe(job->camera, job->frame_index(),
                             mapping.process(*job, result.times, {}, publish));
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
  return result;
}

}  // namespace hybrid_slam
