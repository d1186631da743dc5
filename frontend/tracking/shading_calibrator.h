#pragma once

#include <optional>
#include <string>
#include <vector>

#include "backend/map/features.h"
#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/calibration/running_estimate.h"

namespace hybrid_slam {

struct ShadingCalibratorOptions {
  bool enabled = true;
  double prior_sigma = 1.0;       // of the depth per size, before anything was seen
  double min_significance = 3.0;  // standard deviations from 0 before it is used
  int min_tracks = 50;            // in a keyframe

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// A landmark's way from one stereo keyframe to another: its parallax against what its disparity in
// the first one promises.
struct ShadedTrack {
  double disparity = 0;  // in the first keyframe [px]
  double parallax = 0;   // how far the translation between the keyframes moves the point [px]
  double lag = 0;        // share of the parallax that is missing
  double size = 0;       // scale of the first keypoint over the focal length [rad]
  double sigma = 1;      // standard deviation of positions and of the disparity [px]
};

// `first` and its right coordinate [px], in the first keyframe; NaN gives a track that is not used.
// `depth`: the landmark's, there [m]. The parallax is fitted to both coordinates of `now`.
ShadedTrack make_shaded_track(const Calibrated<RectifiedStereo>& camera,
                              const Rigid3d& now_from_first, const Keypoint& first, double u_right,
                              const Keypoint& now, double depth);

// How much of a lamp's way a pose may be off by, one standard deviation: of the vehicle's lamps,
// whose share was estimated and removed, and of one on an arm, whose share was not.
struct ShadingDoubt {
  double of_vehicle = 0;
  double of_arm = 0;
};

// Lamps that move along with the cameras shade bumps anew from every place: what is seen of a bump
// follows the lamp, and moves less through the images than the ground does. It moves as if it lay
// deeper, by its "shading depth". A stereo pair sees both its images by the same light and is not
// deceived; so the scale of every motion is, and comes out too small.
//
// The shading depth shows as a trend: the larger the keypoints, the more of their parallax is
// missing. An error of the motion's scale is the same for all sizes, and an offset of the
// disparities depends on depth; both are eliminated from the tracks of every keyframe. Where
// nothing moves the light there is no trend. What a trend says of the smallest sizes depends on its
// law: natural relief is fractal, heights grow with size^H. Spectra of seafloors at these scales
// have exponents of 3 to 3.5 (Jackson and Richardson, High-Frequency Seafloor Acoustics, 2007),
// which is H = 0.5 to 0.75; rendered ground lies at the upper end.
class ShadingCalibrator {
 public:
  // `start`: what an earlier run has found of the lamps; unused where the calibrator is disabled.
  explicit ShadingCalibrator(const ShadingCalibratorOptions& options,
                             const std::optional<FoundParameter>& start = std::nullopt);

  // The tracks that end in one keyframe. `corrected`: the depth per size by which their positions
  // there were corrected.
  void add(const std::vector<ShadedTrack>& tracks, double corrected);

  // Shading depth over size, of features of one milliradian; 0 as long as it is not significant.
  // Changes at stated numbers of keyframes alone.
  double depth_per_size() const { return estimate_.in_use(); }
  double sigma() const { return estimate_.sigma(); }  // standard deviation of the estimate

  const RunningEstimate& estimate() const { return estimate_; }

  // Of a pose that rests on features of about this size [rad]; none where lamps stand still.
  ShadingDoubt doubt(double size) const;

  // Shading depth over depth, of features of `size` [rad].
  static double relative_depth(double depth_per_size, double size);

 private:
  ShadingCalibratorOptions options_;
  RunningEstimate estimate_;
};

}  // namespace hybrid_slam
