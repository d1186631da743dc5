#pragma once

#include <cstdint>
#include <vector>

#include "backend/map/map.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

struct FillOptions {
  std::size_t stride = 1;        // every how many frames one becomes a keyframe
  double rotation_noise = 0;     // of the initial poses, the origin left out [rad]
  double translation_noise = 0;  // [m]
  double point_noise = 0;        // of the initial points [m]
  std::uint64_t seed = 7;
};

struct FilledMap {
  Map map;
  std::vector<std::size_t> frames;    // of the scene, that became keyframes
  std::vector<KeyframeId> keyframes;  // one per entry of `frames`
  std::vector<LandmarkId> landmarks;  // one per landmark of the scene; invalid if not in the map
};

// A map of the scene: every keypoint that has a landmark observes it, wrong matches included.
// Landmarks are born with their first stereo match, or with their second observation.
FilledMap fill_map(const SyntheticScene& scene, const FillOptions& options);

}  // namespace hybrid_slam
