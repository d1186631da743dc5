#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cameras/geometry/sim3d.h"
#include "frontend/pose/bearing_observation.h"

namespace hybrid_slam {

// A point that two views know, each from its own surroundings: where its own camera saw it, and
// where it lies. Of both, `point_in_world` is the point in the frame of that view's camera.
struct PointPair {
  BearingObservation in_a;
  BearingObservation in_b;
};

struct RelativePoseOptions {
  bool with_scale = false;    // else the scale is 1
  double chi2 = 9.21;         // 99 %, 2 degrees of freedom: of an inlier, both ways
  double confidence = 0.99;   // of having drawn a sample of inliers
  int max_iterations = 300;   // ORB-SLAM2's
  int min_inliers = 20;       // likewise
  int refinement_rounds = 5;  // inliers are chosen anew after each
  std::uint64_t seed = 0;

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

struct RelativePose {
  Sim3d a_from_b;
  std::vector<char> inlier;  // one per pair
  int inliers = 0;
};

// The similarity between two views, or with the scale fixed the rigid motion, from pairs of which
// many may be wrong: RANSAC over three points in closed form (Umeyama, PAMI 1991), then
// refine_relative_pose. None if no sample has min_inliers. Same seed, same result.
std::optional<RelativePose> solve_relative_pose_ransac(std::span<const PointPair> pairs,
                                                       const RelativePoseOptions& options);

// Minimises the directions' errors in both views: that of b's point against a's bearing and of a's
// point against b's bearing, of the pairs that are inliers both ways, which are chosen anew
// (ORB-SLAM2's OptimizeSim3, on bearings, so that any camera will do). Damped Gauss-Newton,
// perturbation on the left. None with fewer than min_inliers left, or where they leave it open.
std::optional<RelativePose> refine_relative_pose(std::span<const PointPair> pairs,
                                                 const Sim3d& initial_a_from_b,
                                                 const RelativePoseOptions& options);

}  // namespace hybrid_slam
