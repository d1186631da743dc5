#include "apps/pipeline/frame_tracking.h"

#include <utility>

namespace hybrid_slam {

FrameTracking::FrameTracking(const FrameSource& source, const SlamOptions& options,
                             const Vocabulary& vocabulary, LocalMapping& mapping,
                             Recorder& recorder, StageTimes& times)
    : places_(std::make_shared<KeyframeDatabase>(vocabulary)),
      stereo_(mapping.add_camera(source.camera()), source.camera(), options.tracking, places_),
      recorder_(recorder),
      times_(times) {
  if (source.fisheye() != nullptr) {
    fisheye_.emplace(mapping.add_camera(*source.fisheye()), *source.fisheye(),
                     options.fisheye.tracking, places_);
  }
}

std::optional<FrameSet> FrameTracking::next(OrderedLoader& loader) {
  while (!recorder_.cancelled()) {
    auto loaded = loader.next();
    if (!loaded) {
      recorder_.cancelled();  // which can be why nothing comes any more
      break;
    }
    if (loaded->frames) {
      return std::move(loaded->frames);
    }
    recorder_.corrupt(loaded->error);
  }
  return std::nullopt;
}

std::optional<MappingJob> FrameTracking::track(Frame stereo, const MapSnapshot& map,
                                               bool allow_keyframe) {
  StageClock clock(times_);
  places_->follow(map);
  TrackedFrame tracked = stereo_.track(std::move(stereo), map, allow_keyframe);
  clock.lap("track");
  stereo_reference_ = tracked.reference;
  return finish(CameraKind::kStereo, std::move(tracked), map);
}

std::optional<MappingJob> FrameTracking::track_fisheye(FrameSet frames, const MapSnapshot& map,
                                                       bool allow_keyframe) {
  if (!frames.fisheye_error.empty()) {
    recorder_.fisheye_missing(frames.fisheye_error);
  }
  if (!frames.fisheye || !fisheye_) {
    return std::nullopt;
  }
  StageClock clock(times_);
  places_->follow(map);
  TrackedFrame tracked =
      fisheye_->track(std::move(*frames.fisheye), map, stereo_reference_, allow_keyframe);
  clock.lap("track_fisheye");
  return finish(CameraKind::kFisheye, std::move(tracked), map);
}

std::optional<MappingJob> FrameTracking::finish(CameraKind camera, TrackedFrame tracked,
                                                const MapSnapshot& map) {
  append_counts(tracked.counts, counts_);
  recorder_.tracked(camera, tracked, map);
  if (!tracked.keyframe) {
    return std::nullopt;
  }
  return MappingJob{camera, std::move(*tracked.keyframe), std::exchange(counts_, {})};
}

}  // namespace hybrid_slam
