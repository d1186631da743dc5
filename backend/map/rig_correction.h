#pragma once

#include <optional>

namespace hybrid_slam {

// One parameter of a camera, as far as runs have found it.
struct FoundParameter {
  double value = 0;
  double sigma = 0;       // standard deviation by the noise of the measurements
  double systematic = 0;  // likewise, by what shifts all of them alike
  double in_use = 0;      // what is taken out of keyframes; 0: it is not shown

  bool operator==(const FoundParameter&) const = default;
};

// How the right camera of a pair stands otherwise than the calibration says, as far as the rows of
// matches tell. A camera turned by small angles (x, y, z) about its own axes shows the ray (u, v,
// 1) off by
//   columns: y - z v + u (y u - x v)         rows: z u - x + v (y u - x v)
// and one of another focal length by (s u, s v), all times the focal length. So rows tell of x, z
// and s; y shifts all columns alike, which rows do not show but for the small v u.
struct PairAlignment {
  double pitch = 0;        // x [rad]
  double roll = 0;         // z [rad]
  double focal_ratio = 0;  // s: the right focal length over the left one, less 1
  int matches = 0;         // that agree
  double row_rms = 0;      // by which the rows are off as the above says, of the matches [px]
  double row_sigma = 0;    // what is left over: standard deviation of one match [px]
  // Standard deviations.
  double pitch_sigma = 0, roll_sigma = 0, focal_sigma = 0;

  bool operator==(const PairAlignment&) const = default;
};

// What was found out about a stereo camera: it holds for all its keyframes, and is where the next
// run with the map begins.
struct RigCorrection {
  std::optional<PairAlignment> rows;        // taken out of the right images
  std::optional<FoundParameter> disparity;  // offset [px], see DisparityCalibrator
  std::optional<FoundParameter> shading;    // depth per size, see ShadingCalibrator

  bool empty() const { return !rows && !disparity && !shading; }
  bool operator==(const RigCorrection&) const = default;
};

}  // namespace hybrid_slam
