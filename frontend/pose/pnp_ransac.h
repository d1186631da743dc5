#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

struct PnpRansacOptions {
  double confidence = 0.99;
  int max_iterations = 300;
  int min_inliers = 10;
  std::uint64_t seed = 0;
};

struct PnpResult {
  Rigid3d cam_from_world;
  std::vector<char> inlier;  // one per correspondence
  int inliers = 0;
};

// Pose from bearings (unit vectors in the camera) and points in the world, by minimal solvers
// inside RANSAC; works for every camera model, rays beyond 90 degrees included. angular_sigma[i] is
// the standard deviation of bearing i [rad]; an inlier lies within chi2 5.991 of it. None if no
// pose has min_inliers. Same seed, same result.
std::optional<PnpResult> solve_pnp_ransac(std::span<const Eigen::Vector3d> bearings,
                                          std::span<const Eigen::Vector3d> points_in_world,
                                          std::span<const double> angular_sigma,
                                          const PnpRansacOptions& options);

}  // namespace hybrid_slam
