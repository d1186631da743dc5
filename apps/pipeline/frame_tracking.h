#pragma once

#include <memory>
#include <optional>

#include "apps/pipeline/local_mapping.h"
#include "apps/pipeline/ordered_loader.h"
#include "apps/pipeline/recorder.h"
#include "frontend/place_recognition/keyframe_database.h"
#include "frontend/tracking/fisheye_tracker.h"
#include "frontend/tracking/stereo_tracker.h"

namespace hybrid_slam {

// What both modes do with frames: takes them from the loader, tracks them, keeps the books and
// gathers what the next keyframe takes along. One thread.
class FrameTracking {
 public:
  // Adds the source's cameras to the map, if it does not have them yet.
  FrameTracking(const FrameSource& source, const SlamOptions& options, const RunOptions& run,
                LocalMapping& mapping, Recorder& recorder, StageTimes& times);

  // Waits for the next frames that could be read; those before are done. None at the end, or when
  // the run is cancelled.
  std::optional<FrameSet> next(OrderedLoader& loader);

  // What mapping has to do, if the frame shall become a keyframe.
  std::optional<MappingJob> track(Frame stereo, const MapSnapshot& map, bool allow_keyframe = true);

  // The same of the fisheye's frame, after the stereo frame of the same time; nothing if it has
  // none.
  std::optional<MappingJob> track_fisheye(FrameSet frames, const MapSnapshot& map,
                                          bool allow_keyframe = true);

  // The words of the map's keyframes, which follow it: for use in the same thread.
  std::shared_ptr<KeyframeDatabase> places() const { return places_; }

 private:
  std::optional<MappingJob> finish(CameraKind camera, TrackedFrame tracked, const MapSnapshot& map);

  std::shared_ptr<KeyframeDatabase> places_;
  StereoTracker stereo_;
  std::optional<FisheyeTracker> fisheye_;
  Recorder& recorder_;
  StageTimes& times_;
  bool localize_;                // no frame becomes a keyframe
  std::int64_t first_index_;     // of this run's frames in the map, after those of runs before
  KeyframeId stereo_reference_;  // of the last stereo frame; invalid if that was lost
  MapEdit counts_;               // since the last keyframe
};

}  // namespace hybrid_slam
