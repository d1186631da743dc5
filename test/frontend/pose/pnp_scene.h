#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "frontend/pose/pose_refinement.h"

namespace hybrid_slam::pose_scene {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct PnpSceneOptions {
  Camera camera;
  int count = 100;
  double sigma = 1;      // of the pixels, given ...
  double max_sigma = 0;  // ... or uniform up to here, where this is larger
  double outlier_share = 0;
  double min_angle = 0;  // of the rays off the axis [rad]
  double max_angle = 3.1;
  double min_distance = 2;  // of the points [m]
  double max_distance = 12;
  bool planar = false;
  double thickness = 0;  // the points of a plane leave it by so much [m]
  std::uint64_t seed = 0;
};

struct PnpScene {
  Camera camera;
  Rigid3d truth;  // cam_from_world
  std::vector<PoseObservation> observations;
  std::vector<char> is_outlier;
};

// Points whose projections are spread over the image, in space or on a plane at random tilt, seen
// from a random pose; pixels with noise of their sigma, outliers anywhere in the image.
PnpScene make_pnp_scene(const PnpSceneOptions& options);

}  // namespace hybrid_slam::pose_scene
