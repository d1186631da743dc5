#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "apps/slam/session_types.h"

namespace hybrid_slam {

// The poses of the newest frames, relative to keyframes, so that they follow what corrects the map.
// Thread-safe.
class PoseHistory {
 public:
  // `size`: frames of each camera that are kept.
  explicit PoseHistory(std::size_t size) : size_(size) {}

  void add(const FrameResult& frame);
  void became_keyframe(const KeyframeResult& keyframe);
  void clear();

  // The frames that the map has elsewhere than it had them when they were last told.
  std::vector<CorrectedPose> corrected(const MapSnapshot& map);

  // Pose at a time in the given map, cam_from_world: that of the frame, or between its two
  // neighbours (translation linear, rotation along the shortest arc). None outside of what is kept,
  // or where a neighbour has no pose.
  std::optional<Rigid3d> at(CameraKind camera, Nanoseconds time, const MapSnapshot& map) const;

 private:
  struct Entry {
    Nanoseconds time = 0;
    std::int64_t index = 0;
    bool has_pose = false;
    KeyframeId reference;  // invalid for the frame that starts the map: from the world
    Rigid3d cam_from_reference;
    Rigid3d told;  // cam_from_world
  };
  static std::optional<Rigid3d> pose(const Entry& entry, const MapSnapshot& map);

  std::size_t size_;
  mutable std::mutex mutex_;
  std::map<CameraKind, std::deque<Entry>> frames_;  // guarded by mutex_; ascending in time
};

}  // namespace hybrid_slam
