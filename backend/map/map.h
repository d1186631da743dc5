#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "backend/map/map_edit.h"
#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

// The map: the only owner of keyframes and landmarks, changed through its verbs alone, each of
// which keeps landmarks' derived attributes, covisibility and spanning tree right. Not thread-safe:
// one owner; others read snapshots.
class Map {
 public:
  Map();

  CameraId add_camera(const Camera& camera);

  // The first keyframe is the origin. Landmarks of `tracked` that are gone are dropped.
  KeyframeId add_keyframe(const NewKeyframe& keyframe);

  void apply(const MapEdit& edit);

  // New poses and points, from an optimisation.
  void move(const std::vector<std::pair<KeyframeId, Rigid3d>>& cam_from_world,
            const std::vector<std::pair<LandmarkId, Eigen::Vector3d>>& point_in_world);

  // The same in steps, of which the second may be done in any thread while this map goes on: a map
  // of its own with this content, which costs next to nothing; move() on that; then it is taken in.
  // `then`: a snapshot of this map as the branch was made. Until the end nothing else may have
  // moved this map; what was done to it since stays done. Costs what changed since.
  Map branch();
  void take_in_moves(const MapSnapshot& then, Map branch);

  // Those of two keyframes become one, named by the older: their places against one another are
  // known from now on. Nothing where they are one already, or a keyframe is gone.
  void join_components(KeyframeId a, KeyframeId b);

  void set_camera(CameraId id, const Camera& camera);  // refined intrinsics
  void set_keep(KeyframeId id);                        // exempt from culling

  // What is known of a stereo camera by now. Nothing that was measured changes.
  void set_correction(CameraId id, const RigCorrection& correction);

  // What an optimiser knows of how certain the poses are; null: nothing.
  void set_covariances(std::shared_ptr<const KeyframeCovariances> covariances);

  // Drops the features of a keyframe that have neither a landmark nor a right match. The others
  // keep their order and get new indices, wherever the map names them. Returns their old ones,
  // ascending; nothing was done, and the indices hold, if that is all of them. Empty for a keyframe
  // that is not in the map.
  std::vector<std::uint32_t> drop_features(KeyframeId id);

  const MapSnapshot& view() const { return view_; }  // valid until the next verb
  std::shared_ptr<const MapSnapshot> snapshot();

  // Everything that must hold between the tables; empty if all is well, else one line per fault.
  std::vector<std::string> check_consistency() const;

 private:
  friend struct MapFileAccess;  // backend/map/map_file_format.h

  MapSnapshot view_;
};

}  // namespace hybrid_slam
