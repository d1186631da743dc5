#pragma once

#include <optional>
#include <span>
#include <string>

#include "backend/map/map_snapshot.h"
#include "cameras/camera.h"
#include "frontend/calibration/disparity_offset_fit.h"
#include "frontend/calibration/running_estimate.h"

namespace hybrid_slam {

struct DisparityCalibratorOptions {
  bool enabled = true;
  double prior_sigma = 0.2;       // [px] of the offset, before anything was seen
  double min_significance = 3.0;  // standard deviations from 0 before the offset is used
  int min_matches = 50;           // in a pair of keyframes

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// A rectified pair is never perfectly rectified: a small turn of one camera about its vertical axis
// shifts all disparities by nearly the same offset, and with them the scale of every motion. The
// offset shows when the cameras move: near and far points, and both moments, must tell of one
// motion. This estimator adds up what successive keyframes say of it, pair by pair, by the
// landmarks that both see: the map has judged these, where matches from frame to frame are chosen
// by how well they fit a motion with wrong disparities, and keyframes are farther apart.
//
// Where all is about equally far (a seafloor from above), this is a line through a short row of
// disparities, extended to zero. Noise flattens it unless the noise of each coordinate is known
// exactly: by the share noise / spread of the disparities (variances), which at zero disparity is
// that share of the mean disparity. So does whatever else changes the motion that is seen. Pairs do
// not average that out; it is part of sigma().
class DisparityCalibrator {
 public:
  // `start`: what an earlier run has found of the camera; unused where the calibrator is disabled.
  DisparityCalibrator(CameraId camera_id, const Calibrated<RectifiedStereo>& camera,
                      const DisparityCalibratorOptions& options,
                      const std::optional<FoundParameter>& start = std::nullopt);

  // Looks at keyframes of this run that are new in the map: once another is newer, for then they
  // have been optimised.
  void follow(const MapSnapshot& map);

  // What the pair's camera measured before anything was subtracted from u_right, from two places.
  void add(std::span<const StereoSight> sights, const Rigid3d& current_from_previous);

  // [px]; 0 as long as it is not significant. Changes at stated numbers of pairs alone.
  double offset() const { return estimate_.in_use(); }
  double sigma() const { return estimate_.sigma(); }  // standard deviation of the estimate [px]

  const RunningEstimate& estimate() const { return estimate_; }

 private:
  void add(const MapSnapshot& map, const Keyframe& keyframe);

  CameraId camera_id_;
  Calibrated<RectifiedStereo> camera_;
  DisparityCalibratorOptions options_;
  RunningEstimate estimate_;
  KeyframeId next_{0};   // those before have been looked at
  KeyframeId first_{0};  // those before were judged with quite another offset in use
  bool judges_anew_ = false;
  SightNoise noise_;  // as the last pair has it
};

}  // namespace hybrid_slam
