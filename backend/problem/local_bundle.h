#pragma once

#include <cstddef>
#include <span>

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

struct LocalBundleOptions {
  int min_shared_landmarks = 15;    // of a covisible keyframe that varies too
  std::size_t max_neighbours = 20;  // those with most landmarks in common
  std::size_t max_fixed = 60;       // outer observers, those with most observations
  ProblemOptions problem;
};

// Local bundle adjustment: the keyframes and their covisible ones vary (stereo and fisheye mixed),
// those which their odometry begins at, and so do all landmarks they see; odometry joins them;
// other keyframes that see these landmarks are fixed, and so is the origin. Where neither exists,
// the oldest keyframe is fixed instead. Empty if none of the keyframes is in the map.
ProblemConfig make_local_bundle(const MapSnapshot& map, std::span<const KeyframeId> around,
                                const LocalBundleOptions& options);
inline ProblemConfig make_local_bundle(const MapSnapshot& map, KeyframeId around,
                                       const LocalBundleOptions& options) {
  return make_local_bundle(map, {&around, 1}, options);
}

}  // namespace hybrid_slam
