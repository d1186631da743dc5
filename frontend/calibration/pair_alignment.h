#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "cameras/camera.h"
#include "frontend/features/image.h"
#include "frontend/matching/pair_matches.h"

namespace hybrid_slam {

// How the right camera of a pair stands otherwise than the calibration says, as far as the rows of
// matches tell. A camera turned by small angles (x, y, z) about its own axes shows the ray (u, v,
// 1) off by
//   columns: y - z v + u (y u - x v)         rows: z u - x + v (y u - x v)
// and one of another focal length by (s u, s v), all times the focal length. So rows tell of x, z
// and s; y shifts all columns alike, which rows do not show but for the small v u: that is left to
// DisparityCalibrator.
struct PairAlignment {
  // [px] by which rows may be off: it costs no matches, which have 1 px of room. Few matches
  // claimed 0.58 px of a sound pair.
  static constexpr double kHarmlessRows = 0.75;

  double pitch = 0;        // x [rad]
  double roll = 0;         // z [rad]
  double focal_ratio = 0;  // s: the right focal length over the left one, less 1
  int matches = 0;         // that agree
  double row_rms = 0;      // by which the rows are off as the above says, of the matches [px]
  double row_sigma = 0;    // what is left over: standard deviation of one match [px]

  // Whether it is no accident (once in a million pairs that are aligned), and worth a correction:
  // more than the noise of a single match and than what is harmless.
  bool is_shown() const;
};

// None with few matches: kFewest that agree. Of small keypoints alone, whose places are good.
std::optional<PairAlignment> find_pair_alignment(const Calibrated<RectifiedStereo>& camera,
                                                 std::span<const PairMatch> matches);

// Makes right images what a right camera would have seen that stands as calibrated: a homography.
// Beyond the border the image goes on as at its edge.
class RightAligner {
 public:
  RightAligner(const Calibrated<RectifiedStereo>& camera, const PairAlignment& alignment);

  // Of the calibrated size; several threads at a time.
  void align(GrayImage& right) const;

 private:
  Eigen::Matrix3d raw_from_aligned_;  // of pixels
};

}  // namespace hybrid_slam
