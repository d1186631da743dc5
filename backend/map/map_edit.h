#pragma once

#include <memory>
#include <vector>

#include "backend/map/frame_observations.h"
#include "backend/map/ids.h"
#include "backend/map/landmark.h"
#include "backend/map/odometry.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// A landmark to be born, with all the observations that made it.
struct NewLandmark {
  Eigen::Vector3d point_in_world;
  std::vector<Observation> observations;
};

// One observation of a landmark.
struct LandmarkObservation {
  LandmarkId landmark;
  Observation observation;
};

// Two landmarks that are the same point. The observations of `drop` go to `keep`, except in
// keyframes where `keep` is already seen.
struct LandmarkMerge {
  LandmarkId keep;
  LandmarkId drop;
};

// How often a landmark should have been seen by tracking, and was, since that was last told.
struct LandmarkCount {
  LandmarkId landmark;
  int visible = 0;
  int found = 0;
};

// A frame that becomes a keyframe: what tracking hands to the backend.
struct NewKeyframe {
  std::shared_ptr<const FrameObservations> observations;
  Rigid3d cam_from_world;
  std::vector<LandmarkId> landmarks;  // one per keypoint: what was tracked; invalid elsewhere
  std::vector<std::pair<std::uint32_t, Eigen::Vector3d>>
      new_points;        // keypoint, point in world: landmarks to be born
  KeyframeId reference;  // the keyframe it was tracked against: its parent while nothing is shared
  // Null where there is none. Left out if it does not begin at the keyframe before.
  std::shared_ptr<const Odometry> odometry{};
};

// A transaction: applied whole, in the order of the members below. It was made from a snapshot, so
// what it names may have gone meanwhile: such entries are skipped, and so is an observation whose
// keypoint or keyframe already has another landmark. Where features were dropped since the
// snapshot, erased observations are found again; new ones must name the keypoints that the map has
// now.
struct MapEdit {
  std::vector<LandmarkMerge> merged;
  std::vector<LandmarkObservation> new_observations;
  std::vector<NewLandmark> new_landmarks;
  std::vector<LandmarkObservation> erased_observations;
  std::vector<LandmarkId> erased_landmarks;
  std::vector<KeyframeId> erased_keyframes;
  std::vector<LandmarkCount> counted;

  bool empty() const {
    return merged.empty() && new_observations.empty() && new_landmarks.empty() &&
           erased_observations.empty() && erased_landmarks.empty() && erased_keyframes.empty() &&
           counted.empty();
  }
};

}  // namespace hybrid_slam
