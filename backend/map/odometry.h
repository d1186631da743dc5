#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "backend/map/ids.h"
#include "cameras/geometry/uncertain_motion.h"

namespace hybrid_slam {

struct MapTables;

// How a stereo pair moved from its keyframe before to this one, as its odometer measured it from
// frame to frame. It holds the two together where landmarks do not.
struct Odometry {
  KeyframeId previous;     // the keyframe of the same camera before this one
  UncertainMotion motion;  // cam_from_previous
  // Keypoints of this keyframe that the odometer followed into it, ascending. Where they are
  // landmarks that both keyframes see, the map holds the same measurements a second time.
  std::vector<std::uint32_t> keypoints;
  std::uint32_t dropped = 0;  // followed likewise, and no longer among the keyframe's features

  std::size_t followed() const { return keypoints.size() + dropped; }
};

// A motion of which nothing is known but a guess: 30 m and a radian, standard deviations, each way.
UncertainMotion unknown_motion(const Rigid3d& guess);

// Whether it is such a motion, or one that contains it: it holds nothing together.
bool is_loose(const Odometry& odometry);

// Whether all is finite, the covariance symmetric and positive definite, and every keypoint one of
// so many.
bool is_valid(const Odometry& odometry, std::size_t keypoint_count);

// Gives a keyframe that was just added its odometry, unless that does not begin at the living
// keyframe of the same camera right before it: so keyframes form chains, without forks.
void attach_odometry(MapTables& tables, KeyframeId id, std::shared_ptr<const Odometry> odometry);

// Before a keyframe is erased: the one after it goes on from the one before it, by both motions. It
// has none where one of the two is missing.
void detach_odometry(MapTables& tables, KeyframeId id);

// The living keyframe of the same camera right before this one; invalid if there is none.
KeyframeId keyframe_before(const MapTables& tables, KeyframeId id);

}  // namespace hybrid_slam
