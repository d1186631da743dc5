#pragma once

#include <optional>
#include <string>

#include "cameras/camera.h"
#include "frontend/calibration/running_estimate.h"
#include "frontend/odometry/stereo_odometer.h"

namespace hybrid_slam {

struct DisparityCalibratorOptions {
  bool enabled = true;
  double prior_sigma = 0.2;       // [px] of the offset, before anything was seen
  double min_significance = 3.0;  // standard deviations from 0 before the offset is used
  int min_matches = 50;           // in a pair of frames

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// A rectified pair is never perfectly rectified: a small turn of one camera about its vertical axis
// shifts all disparities by nearly the same offset, and with them the scale of every motion. The
// offset shows when the cameras move: near and far points, and both moments, must tell of one
// motion. This estimator adds up what the odometer's matches say of it, pair by pair: Gauss-Newton
// in the motion and the offset (u_right measured = u_right true + offset), the motion eliminated,
// the noise taken from the residuals themselves.
//
// Where all is about equally far (a seafloor from above), this is a line through a short row of
// disparities, extended to zero. Noise flattens it unless the noise of each coordinate is known
// exactly: by the share noise / spread of the disparities (variances), which at zero disparity is
// that share of the mean disparity. So does whatever else changes the motion that is seen. Pairs do
// not average that out; it is part of sigma().
class DisparityCalibrator {
 public:
  // `start`: what an earlier run has found of the camera; unused where the calibrator is disabled.
  DisparityCalibrator(const Calibrated<RectifiedStereo>& camera,
                      const DisparityCalibratorOptions& options,
                      const std::optional<FoundParameter>& start = std::nullopt);

  // The inliers of a motion. `*_correction` [px]: what was already subtracted from u_right.
  void add(const StereoFeatures& previous, double previous_correction,
           const StereoFeatures& current, double current_correction, const StereoMotion& motion);

  // [px]; 0 as long as it is not significant. Changes at stated numbers of pairs alone.
  double offset() const { return estimate_.in_use(); }
  double sigma() const { return estimate_.sigma(); }  // standard deviation of the estimate [px]

  const RunningEstimate& estimate() const { return estimate_; }

 private:
  Calibrated<RectifiedStereo> camera_;
  DisparityCalibratorOptions options_;
  RunningEstimate estimate_;
};

}  // namespace hybrid_slam
