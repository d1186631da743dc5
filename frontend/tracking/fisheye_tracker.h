#pragma once

#include <memory>
#include <optional>
#include <string>

#include "backend/map/map_snapshot.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/last_frame.h"
#include "frontend/tracking/map_matcher.h"
#include "frontend/tracking/tracked_frame.h"
#include "frontend/tracking/uncertain_pose.h"

namespace hybrid_slam {

struct FisheyeTrackerOptions : TrackerOptions {
  FisheyeTrackerOptions();

  std::string validate() const;
};

// Tracks the frames of a fisheye that moves by itself against a map that the stereo pair keeps up
// (the paper's section on tracking fisheye frames). Nothing is assumed of its motion: between two
// frames of a low rate an arm can swing anywhere. A frame is found by the descriptors of a
// keyframe, PnP on bearings in RANSAC and a guided search: first in the reference, the keyframe of
// either camera that shared most landmarks with the last frame, then in the stereo pair's
// reference, then in the keyframes that look most like it. Then the local map, as for stereo
// frames. One thread at a time; never changes the map.
class FisheyeTracker {
 public:
  // `places`: where to look for lost frames (MapMatcher). Throws std::invalid_argument if the
  // options are not valid.
  FisheyeTracker(CameraId camera_id, const Calibrated<KannalaBrandt>& camera,
                 const FisheyeTrackerOptions& options,
                 std::shared_ptr<const KeyframeDatabase> places = nullptr);

  // `stereo_reference`: of the stereo frame of the same time, invalid if that is lost.
  // `allow_keyframe`: false while mapping has more waiting than it can take.
  TrackedFrame track(Frame frame, const MapSnapshot& map, KeyframeId stereo_reference,
                     bool allow_keyframe = true);

  // What the camera's keypoints are off by besides their own noise, from now on; null: nothing.
  // Those of the frames to come have it in their standard deviations already.
  void use_floor(std::shared_ptr<const NoiseFloor> floor) { matcher_.use_floor(std::move(floor)); }

  // What the last frame's pose is off by, for relative_pose(); null if it was lost.
  const UncertainPose* uncertain_pose() const { return uncertain_ ? &*uncertain_ : nullptr; }

 private:
  std::vector<KeyframeId> candidates(const MapSnapshot& map, KeyframeId stereo_reference) const;
  bool is_certain(const PoseSupport& support) const;
  bool wants_keyframe(const Frame& frame, const MapSnapshot& map, const TrackedFrame& result) const;

  CameraId camera_id_;
  Camera camera_;
  double focal_;  // [px]
  FisheyeTrackerOptions options_;
  MapMatcher matcher_;
  LastFrame last_;
  std::optional<UncertainPose> uncertain_;  // the last frame
};

}  // namespace hybrid_slam
