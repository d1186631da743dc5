#include "apps/pipeline/frame_tracking.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace hybrid_slam {

namespace {

std::int64_t next_frame_index(const MapSnapshot& map) {
  std::int64_t next = 0;
  for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
    next = std::max(next, map.newest_frame_index(CameraId(i)) + 1);
  }
  return next;
}

StereoTrackerOptions stereo_options(const FrameSource& source, const SlamOptions& options) {
  StereoTrackerOptions stereo = options.tracking;
  if (source.fisheye() != nullptr) {
    stereo.keyframes.min_tracked_ratio =
        std::max(stereo.keyframes.min_tracked_ratio, options.fisheye.stereo_tracked_ratio);
  }
  return stereo;
}

}  // namespace

FrameTracking::FrameTracking(const FrameSource& source, const SlamOptions& options,
                             const RunOptions& run, LocalMapping& mapping, Recorder& recorder,
                             StageTimes& times)
    : places_(std::make_shared<KeyframeDatabase>(run.vocabulary)),
      stereo_(mapping.camera_id(source.camera()), source.camera(), stereo_options(source, options),
              places_),
      recorder_(recorder),
      times_(times),
      localize_(run.localize),
      first_index_(next_frame_index(mapping.map().view())) {
  if (localize_ && !mapping.map().view().origin().valid()) {
    throw std::logic_error("FrameTracking: nothing to localise in");
  }
  if (source.fisheye() != nullptr) {
    fisheye_.emplace(mapping.camera_id(*source.fisheye()), *source.fisheye(),
                     options.fisheye.tracking, places_);
  }
}

std::optional<FrameSet> FrameTracking::next(OrderedLoader& loader) {
  recorder_.frame_done();
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
  stereo.index += first_index_;
  TrackedFrame tracked = stereo_.track(std::move(stereo), map, allow_keyframe && !localize_);
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
  frames.fisheye->index += first_index_;
  TrackedFrame tracked = fisheye_->track(std::move(*frames.fisheye), map, stereo_reference_,
                                         allow_keyframe && !localize_);
  clock.lap("track_fisheye");
  return finish(CameraKind::kFisheye, std::move(tracked), map);
}

std::optional<MappingJob> FrameTracking::finish(CameraKind camera, TrackedFrame tracked,
                                                const MapSnapshot& map) {
  if (!localize_) append_counts(tracked.counts, counts_);  // no keyframe would take them
  recorder_.tracked(camera, tracked, map);
  if (!tracked.keyframe) {
    return std::nullopt;
  }
  const KeyframeId reference = tracked.keyframe->reference;
  return MappingJob{camera, std::move(*tracked.keyframe),
                    reference.valid() ? map.cam_from_world(reference) : Rigid3d(),
                    std::exchange(counts_, {})};
}

}  // namespace hybrid_slam
