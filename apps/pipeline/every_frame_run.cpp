#include <algorithm>
#include <memory>
#include <optional>

#include "apps/pipeline/local_mapping.h"
#include "apps/pipeline/ordered_loader.h"
#include "apps/pipeline/recorder.h"
#include "apps/pipeline/slam_run.h"

namespace hybrid_slam {
namespace {

void save_checkpoint(const RunHooks& hooks, RunResult& result, Recorder& recorder) {
  StageClock clock(result.times);
  const std::string failure = hooks.checkpoint(*result.map);
  clock.lap("checkpoint");
  if (!failure.empty()) {
    recorder.warn({failure});
  }
}

}  // namespace

RunResult run_every_frame(const FrameSource& source, const SlamOptions& options,
                          const RunOptions& run, const RunHooks& hooks) {
  RunResult result;
  const std::size_t total = run.limit > 0 ? std::min(run.limit, source.size()) : source.size();
  Recorder recorder(result, hooks, total);
  LocalMapping mapping(options);
  StereoTracker tracker(mapping.add_camera(source.camera()), source.camera(), options.tracking);
  result.map = mapping.snapshot();
  const auto publish = [&] { result.map = mapping.snapshot(); };
  MapEdit counts;
  int keyframes = 0;

  OrderedLoader loader(source, run.threads, [next = std::size_t{0}, total]() mutable {
    return next < total ? std::optional(next++) : std::nullopt;
  });
  while (!recorder.cancelled()) {
    auto loaded = loader.next();
    if (!loaded) {
      break;
    }
    if (!loaded->frame) {
      recorder.corrupt(loaded->error);
      continue;
    }
    StageClock clock(result.times);
    TrackedFrame tracked = tracker.track(std::move(*loaded->frame), *result.map);
    clock.lap("track");
    append_counts(tracked.counts, counts);
    recorder.tracked(tracked, *result.map);
    if (tracked.keyframe) {
      const MappingJob job{std::move(*tracked.keyframe), std::exchange(counts, {})};
      recorder.became_keyframe(tracked.frame_index,
                               mapping.process(job, result.times, {}, publish));
      ++keyframes;
      if (run.checkpoint_every > 0 && keyframes % run.checkpoint_every == 0) {
        save_checkpoint(hooks, result, recorder);
      }
    }
  }
  loader.stop();
  loader.join();
  result.times.merge(loader.times());
  return result;
}

}  // namespace hybrid_slam
