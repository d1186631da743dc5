#pragma once

#include <memory>
#include <vector>

#include "backend/map/frame_observations.h"
#include "backend/map/ids.h"
#include "backend/map/odometry.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// An edge of the covisibility graph.
struct Covisible {
  KeyframeId id;
  int shared_landmarks = 0;
  bool operator==(const Covisible&) const = default;
};

// A frame that stays in the map. Its observations never change and are shared; its pose and its
// links do, and its observations are replaced where Map::drop_features() says so. The map's verbs
// (backend/map/map.h) are the only writers.
struct Keyframe {
  KeyframeId id;
  std::shared_ptr<const FrameObservations> observations;
  Rigid3d cam_from_world;
  std::vector<LandmarkId> landmarks;         // one per keypoint; invalid where there is none
  std::vector<Covisible> covisible;          // every keyframe sharing a landmark, ascending by id
  KeyframeId parent;                         // in the spanning tree; invalid for the origin
  std::vector<KeyframeId> children;          // ascending
  bool keep = false;                         // exempt from culling (origin, ends of loops)
  std::shared_ptr<const Odometry> odometry;  // from the keyframe before; null where there is none
  // Which component of the map it is part of: by the keyframe that this began with; see
  // components.h.
  KeyframeId component;
};

}  // namespace hybrid_slam
