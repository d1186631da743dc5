#pragma once

#include <vector>

#include "backend/map/features.h"
#include "backend/map/ids.h"

#include <Eigen/Core>

namespace hybrid_slam {

struct Observation {
  KeyframeId keyframe;
  std::uint32_t keypoint = 0;  // index into the keyframe's keypoints
  auto operator<=>(const Observation&) const = default;
};

// A point of the map with what is needed to predict how a camera would see it.
struct Landmark {
  LandmarkId id;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  std::vector<Observation> observations;  // ascending by keyframe; at most one per keyframe
  KeyframeId reference;                   // where it was first seen; moved on if that is erased

  // Derived from the observations whenever these change, or the reference's pose does.
  Descriptor descriptor{};                                   // least median distance to the others
  Eigen::Vector3d mean_direction = Eigen::Vector3d::Zero();  // unit, from the cameras to the point
  // Scale in the reference keyframe divided by the focal length of its camera, times the distance
  // from it [m]: the object-space size. A camera of focal length f at distance d sees the landmark
  // at scale f * object_scale / d, stereo or fisheye.
  double object_scale = 0;

  int visible = 0;  // frames in which it should have been seen
  int found = 0;    // frames in which it was
};

}  // namespace hybrid_slam
