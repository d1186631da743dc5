#pragma once

#include <optional>

#include "apps/pipeline/local_mapping.h"
#include "apps/pipeline/ordered_loader.h"
#include "apps/pipeline/recorder.h"

namespace hybrid_slam {

// What both modes do with frames: takes them from the loader, tracks them, keeps the books and
// gathers what the next keyframe takes along. One thread.
class FrameTracking {
 public:
  FrameTracking(const FrameSource& source, const SlamOptions& options, CameraId camera,
                Recorder& recorder, StageTimes& times)
      : tracker_(camera, source.camera(), options.tracking), recorder_(recorder), times_(times) {}

  // Waits for the next frame that could be read. None at the end, or when the run is cancelled.
  std::optional<Frame> next(OrderedLoader& loader);

  // What mapping has to do, if the frame shall become a keyframe.
  std::optional<MappingJob> track(Frame frame, const MapSnapshot& map, bool allow_keyframe = true);

 private:
  StereoTracker tracker_;
  Recorder& recorder_;
  StageTimes& times_;
  MapEdit counts_;  // since the last keyframe
};

}  // namespace hybrid_slam
