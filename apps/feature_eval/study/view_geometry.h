#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// Matched unit bearings of two cameras: a[i] and b[i] are said to show one point.
struct MatchedBearings {
  std::vector<Eigen::Vector3d> a;
  std::vector<Eigen::Vector3d> b;
};

struct ConsensusOptions {
  // [rad]: the distance from the epipolar line (Sampson's) up to which a match is an inlier. On the
  // plane z = 1, in its units.
  double threshold = 1.0 / 600;
  double confidence = 0.999;  // of having drawn a sample of inliers; OpenCV's
  int max_iterations = 1000;  // OpenCV's
};

// Fewer matches than this tell nothing: five are explained by an essential matrix whatever they
// are.
inline constexpr int kMinMatches = 6;

struct ViewMotion {
  Rigid3d a_from_b;          // of length 1
  std::vector<char> inlier;  // one per match
  int inliers = 0;           // of the essential matrix, on whichever side of the cameras
};

// By OpenCV: findEssentialMat in RANSAC and recoverPose, on coordinates of the plane z = 1. Rays at
// 90 degrees from the axis or beyond have none and are no inliers. None without consensus.
std::optional<ViewMotion> motion_on_plane(const MatchedBearings& matches,
                                          const ConsensusOptions& options);

// The same on bearings, which takes rays of any direction: RANSAC over five matches (Nister, PAMI
// 2004, by OpenGV), with Sampson's distance on the unit sphere. Same matches, same result.
std::optional<ViewMotion> motion_on_bearings(const MatchedBearings& matches,
                                             const ConsensusOptions& options);

// Sampson's distance of a match on the unit sphere [rad]: by what the two bearings have to turn, to
// first order and taken together, to lie in one plane with the baseline. E: a' E b = 0.
double sphere_distance(const Eigen::Matrix3d& essential, const Eigen::Vector3d& a,
                       const Eigen::Vector3d& b);

// Angle of the rotation between the two, and between the directions of their translations [deg],
// 0..180. Both translations must not be zero.
double rotation_error_deg(const Rigid3d& estimate, const Rigid3d& truth);
double direction_error_deg(const Rigid3d& estimate, const Rigid3d& truth);

}  // namespace hybrid_slam
