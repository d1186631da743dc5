#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "backend/map/rig_correction.h"
#include "cameras/camera.h"
#include "frontend/features/image.h"
#include "frontend/matching/pair_matches.h"

namespace hybrid_slam {

// [px] by which rows may be off: it costs no matches, which have 1 px of room. Few matches claimed
// 0.58 px of a sound pair.
inline constexpr double kHarmlessRows = 0.75;

// Whether it is no accident (once in a million pairs that are aligned), and worth a correction:
// more than the noise of a single match and than what is harmless.
bool is_shown(const PairAlignment& alignment);

// By the matches' rows; what its turn about y would do to them is left to DisparityCalibrator. None
// with few matches: kFewest that agree. Of small keypoints alone, whose places are good.
std::optional<PairAlignment> find_pair_alignment(const Calibrated<RectifiedStereo>& camera,
                                                 std::span<const PairMatch> matches);

// The matches with this taken out of their rows.
std::vector<PairMatch> aligned(const Calibrated<RectifiedStereo>& camera,
                               const PairAlignment& alignment, std::span<const PairMatch> matches);

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
