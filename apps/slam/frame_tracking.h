#pragma once

#include <memory>
#include <optional>

#include "apps/slam/diagnosis.h"
#include "apps/slam/local_mapping.h"
#include "apps/slam/observers.h"
#include "frontend/calibration/rig_calibrator.h"
#include "frontend/place_recognition/keyframe_database.h"
#include "frontend/tracking/fisheye_tracker.h"
#include "frontend/tracking/lamp_doubt.h"
#include "frontend/tracking/stereo_tracker.h"

namespace hybrid_slam {

// What both modes do with frames: tracks them, tells the observers, and gathers what the next
// keyframe takes along. One thread.
class FrameTracking {
 public:
  // Adds the cameras to the map, if it does not have them yet. `localize`: no frame becomes a
  // keyframe.
  FrameTracking(const CameraRig& cameras, const SlamOptions& options, const Vocabulary& vocabulary,
                bool localize, LocalMapping& mapping, Observers& observers, StageTimes& times);

  // What mapping has to do, if the frame shall become a keyframe. Frames come in the order of their
  // times, a stereo frame before the fisheye's of the same time.
  std::optional<MappingJob> track(CameraFrame frame, const MapSnapshot& map,
                                  bool allow_keyframe = true);

  // After the last frame.
  TrackingEnd end();

  // The words of the map's keyframes, which follow it: for use in the same thread. Who has found
  // them already assigns them before track(), which else does it.
  std::shared_ptr<KeyframeDatabase> places() const { return places_; }

 private:
  std::optional<UncertainMotion> left_from_fisheye(const MapSnapshot& map) const;
  void follow_calibration(CameraFrame& frame, const MapSnapshot& map);
  void learn_calibration(const CameraFrame& frame);
  std::shared_ptr<const RigFindings> findings(const TrackedFrame& tracked);
  RigCorrection correction() const;
  void doubt_lamps(CameraKind camera, const MapSnapshot& map, TrackedFrame& tracked);
  TrackedFrame track_by_camera(CameraFrame& frame, const MapSnapshot& map, bool allow_keyframe);

  std::shared_ptr<KeyframeDatabase> places_;
  CameraId stereo_id_;
  StereoTracker stereo_;
  std::optional<FisheyeTracker> fisheye_;
  Observers& observers_;
  StageTimes& times_;
  bool localize_;
  std::int64_t first_index_;     // of this session's frames in the map, after those of others
  KeyframeId stereo_reference_;  // of the last stereo frame; invalid if that was lost
  LandmarkCounts counts_;        // since the last keyframe
  Diagnosis diagnosis_;
  FloorFinder stereo_floor_;
  std::optional<FloorFinder> fisheye_floor_;
  RigFindings rig_;
  LampDoubt lamps_;
};

}  // namespace hybrid_slam
