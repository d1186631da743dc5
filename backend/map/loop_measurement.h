#pragma once

#include <memory>
#include <vector>

#include "backend/map/frame_observations.h"
#include "backend/map/ids.h"
#include "backend/map/map_edit.h"
#include "cameras/geometry/sim3d.h"

namespace hybrid_slam {

// Two keyframes that see the same place although the map holds it twice: what a loop is closed
// with. Measured from images and from the surroundings of each end, never from where the map has
// put the two. Made from a snapshot, so what it names may have gone meanwhile, as in a MapEdit.
struct LoopMeasurement {
  KeyframeId keyframe;  // the newer one
  KeyframeId match;     // the older one
  // Takes points in the camera frame of `match` to that of `keyframe`, each in the scale of its own
  // surroundings. Its scale is 1 unless with_scale.
  Sim3d keyframe_from_match;
  bool with_scale = false;  // the scale may have drifted: a neighbourhood without stereo

  // Landmarks that are one point; `keep` is the older side's. Each landmark occurs once.
  std::vector<LandmarkMerge> same;
  // Landmarks of the older side that `keyframe` sees in keypoints without a landmark. Their merged
  // counterparts in `same` do not occur here.
  std::vector<LandmarkObservation> new_observations;
  // Whose keypoints these are: the observations of `keyframe` then. Null: those it has in the map.
  std::shared_ptr<const FrameObservations> observations{};
};

}  // namespace hybrid_slam
