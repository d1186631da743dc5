#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/matching/circular_matcher.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {

struct StereoOdometerOptions {
  int ransac_iterations = 200;
  double inlier_threshold = 2.0;  // [px] over the four coordinates
  int min_inliers = 6;
  int max_gauss_newton_iterations = 20;
  std::uint64_t seed = 0;

  std::string validate() const;
};

struct StereoMotion {
  Rigid3d current_from_previous;
  std::vector<CircularMatch> inliers;
  int matches = 0;  // closed circles before RANSAC
};

// Ego-motion between two successive stereo frames from circular matches, as VISO2 does it: RANSAC
// over three points, Gauss-Newton on the reprojection in both images, weights that fall towards the
// image's border. Works for large motions: no prediction is needed.
class StereoOdometer {
 public:
  StereoOdometer(const Calibrated<RectifiedStereo>& camera, const StereoOdometerOptions& options);

  // None if fewer than min_inliers agree.
  std::optional<StereoMotion> estimate(const StereoFeatures& previous,
                                       const StereoFeatures& current) const;

 private:
  Calibrated<RectifiedStereo> camera_;
  StereoOdometerOptions options_;
};

}  // namespace hybrid_slam
