#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cameras/geometry/rigid3d.h"
#include "frontend/pose/bearing_observation.h"

namespace hybrid_slam {

struct PnpRansacOptions {
  double confidence = 0.99;
  int max_iterations = 300;
  int min_inliers = 10;
  std::uint64_t seed = 0;
};

struct PnpResult {
  Rigid3d cam_from_world;
  std::vector<char> inlier;  // one per observation
  int inliers = 0;
};

// Pose from observations of which many may be wrong, without a prediction: minimal solvers inside
// RANSAC, then MLPnP on the inliers, which are chosen anew. An inlier's bearing_chi2 is at most
// 5.991; what is not usable is none. None if no pose has min_inliers or if the inliers leave it
// open. Same seed, same result.
std::optional<PnpResult> solve_pnp_ransac(std::span<const BearingObservation> observations,
                                          const PnpRansacOptions& options);

}  // namespace hybrid_slam
