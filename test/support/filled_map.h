#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "backend/map/map.h"
#include "cameras/geometry/sim3d.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

struct FillOptions {
  std::size_t stride = 1;        // every how many frames one becomes a keyframe
  double rotation_noise = 0;     // of the initial poses, the origin left out [rad]
  double translation_noise = 0;  // [m]
  double point_noise = 0;        // of the initial points [m]
  bool odometry = false;         // keyframes have one, without noise, by all keypoints
  std::uint64_t seed = 7;

  // A place that the map holds twice. From this frame of the scene on nothing of the map before is
  // known: landmarks are born anew, and the two parts share none. The spanning tree alone goes on.
  std::size_t split = std::numeric_limits<std::size_t>::max();
  // new_from_old: what is placed from the split on is wrong by this. Points are split_drift * p;
  // each camera sees its own part from the same directions as before.
  Sim3d split_drift = {};
};

struct FilledMap {
  Map map;
  std::vector<std::size_t> frames;    // of the scene, that became keyframes
  std::vector<KeyframeId> keyframes;  // one per entry of `frames`
  // One per landmark of the scene; invalid if not in the map. Where there is a split, `landmarks`
  // are those of the part after it and `first_landmarks` those of the part before; else these are
  // empty.
  std::vector<LandmarkId> landmarks;
  std::vector<LandmarkId> first_landmarks;
};

// A map of the scene: every keypoint that has a landmark observes it, wrong matches included.
// Landmarks are born with their first stereo match, or with their second observation.
FilledMap fill_map(const SyntheticScene& scene, const FillOptions& options);

// Moves the whole map, as a correction would: the world's axes become others.
void move_world(Map& map, const Rigid3d& new_from_old);

}  // namespace hybrid_slam
