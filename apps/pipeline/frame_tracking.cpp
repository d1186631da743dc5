#include "apps/pipeline/frame_tracking.h"

#include <utility>

namespace hybrid_slam {

std::optional<Frame> FrameTracking::next(OrderedLoader& loader) {
  while (!recorder_.cancelled()) {
    auto loaded = loader.next();
    if (!loaded) {
      recorder_.cancelled();  // which can be why nothing comes any more
      break;
    }
    if (loaded->frame) {
      return std::move(loaded->frame);
    }
    recorder_.corrupt(loaded->error);
  }
  return std::nullopt;
}

std::optional<MappingJob> FrameTracking::track(Frame frame, const MapSnapshot& map,
                                               bool allow_keyframe) {
  StageClock clock(times_);
  TrackedFrame tracked = tracker_.track(std::move(frame), map, allow_keyframe);
  clock.lap("track");
  append_counts(tracked.counts, counts_);
  recorder_.tracked(tracked, map);
  if (!tracked.keyframe) {
    return std::nullopt;
  }
  return MappingJob{std::move(*tracked.keyframe), std::exchange(counts_, {})};
}

}  // namespace hybrid_slam
