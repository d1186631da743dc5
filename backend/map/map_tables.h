#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "backend/map/ids.h"
#include "backend/map/keyframe.h"
#include "backend/map/keyframe_covariances.h"
#include "backend/map/landmark.h"
#include "backend/map/persistent_table.h"
#include "backend/map/rig_correction.h"
#include "cameras/camera.h"

namespace hybrid_slam {

// What is left of an erased keyframe: its place relative to its parent in the spanning tree at that
// moment, so that the frames tracked against it follow all later corrections.
struct ErasedKeyframe {
  KeyframeId parent;
  Rigid3d cam_from_parent;
};

// The content of a map, indexed by the ids' values. Map alone writes it; others see a MapSnapshot.
struct MapTables {
  std::vector<Camera> cameras;
  PersistentTable<Keyframe> keyframes;
  PersistentTable<Landmark> landmarks;
  PersistentTable<ErasedKeyframe> erased;
  KeyframeId origin;
  std::uint32_t next_keyframe = 0;
  std::uint32_t next_landmark = 0;
  std::vector<std::int64_t> newest_frame_index;   // per camera, of any keyframe ever added; or -1
  std::map<CameraId, RigCorrection> corrections;  // of stereo cameras of which something is known
  std::shared_ptr<const KeyframeCovariances> covariances;  // null where nobody told; not saved

  // A complete copy that costs next to nothing; see PersistentTable::share().
  MapTables share() {
    return {cameras,       keyframes.share(), landmarks.share(),  erased.share(), origin,
            next_keyframe, next_landmark,     newest_frame_index, corrections,    covariances};
  }
};

}  // namespace hybrid_slam
