#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "backend/map/ids.h"
#include "backend/map/keyframe.h"
#include "backend/map/landmark.h"
#include "backend/map/map_tables.h"
#include "cameras/camera.h"

namespace hybrid_slam {

// A complete view of the map at one moment. Immutable, cheap to take (what changed since the last
// one), safe to read from any thread. Only Map makes one.
class MapSnapshot {
 public:
  const Keyframe* find(KeyframeId id) const;  // null if unknown or erased
  const Landmark* find(LandmarkId id) const;
  const Keyframe& at(KeyframeId id) const;  // throws std::out_of_range: our own bug
  const Landmark& at(LandmarkId id) const;
  const Camera& camera(CameraId id) const;
  const Camera& camera(const Keyframe& keyframe) const;

  // What was found out about it; nothing of most cameras.
  RigCorrection correction(CameraId id) const;

  std::size_t camera_count() const;
  std::size_t keyframe_count() const;
  std::size_t landmark_count() const;
  std::vector<KeyframeId> keyframe_ids() const;  // ascending
  std::vector<LandmarkId> landmark_ids() const;  // ascending
  KeyframeId origin() const;                     // invalid while the map is empty

  // The id that the next keyframe of the map gets: all that are in it, or ever were, have lower
  // ones.
  KeyframeId next_keyframe_id() const;
  LandmarkId next_landmark_id() const;

  // Keyframes of the id `first` or a higher one, ascending. Costs next_keyframe_id() - first.
  std::vector<KeyframeId> keyframe_ids_from(KeyframeId first) const;

  // Landmarks that were born, changed or erased since an earlier snapshot of the same map; some may
  // be as they were. Ascending. Costs what changed.
  std::vector<LandmarkId> changed_landmarks(const MapSnapshot& since) const;

  // Keyframes that were born, changed (pose, links, landmarks, odometry) or erased since an earlier
  // snapshot of the same map; some may be as they were. Ascending. Costs what changed.
  std::vector<KeyframeId> changed_keyframes(const MapSnapshot& since) const;

  // The keyframe made from a camera's frame; null if there is none, or it was erased. Keyframes
  // enter in the order of their frames, so recent ones are found at once.
  const Keyframe* find_frame(CameraId camera, std::int64_t frame_index) const;

  // The newest living keyframe of a camera; null if there is none.
  const Keyframe* newest_keyframe(CameraId camera) const;

  // Largest frame index of any keyframe of this camera ever added, erased ones included; -1 while
  // there is none.
  std::int64_t newest_frame_index(CameraId camera) const;

  // Pose of a keyframe that is or was in the map, through the spanning tree if it was erased.
  Rigid3d cam_from_world(KeyframeId id) const;

  // The component of a keyframe that is or was in the map; likewise.
  KeyframeId component(KeyframeId id) const;

  // How certain the poses of keyframes around the newest ones are, of each camera, as the
  // incremental smoother found in its last update: null before the first one (a map that was
  // loaded) and where another method optimises. What changed the map since (full bundle adjustment,
  // a loop until it is smoothed) is not in it.
  const KeyframeCovariances* covariances() const { return tables_.covariances.get(); }

  // The covariance of a keyframe's left perturbation against the origin (docs/conventions.md); none
  // where it is not known.
  std::optional<Matrix6d> keyframe_covariance(KeyframeId id) const;

  // Covisible keyframes with at least `min_shared` landmarks in common, most first (ties: lower
  // id), at most `limit`.
  std::vector<Covisible> covisible(KeyframeId id, int min_shared, std::size_t limit) const;

 private:
  friend class Map;
  friend struct MapFileAccess;  // backend/map/map_file_format.h
  explicit MapSnapshot(MapTables tables) : tables_(std::move(tables)) {}

  MapTables tables_;
};

}  // namespace hybrid_slam
