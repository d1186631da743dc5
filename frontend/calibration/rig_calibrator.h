#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/calibration/noise_floor.h"
#include "frontend/calibration/pair_alignment.h"
#include "frontend/calibration/residual_map.h"
#include "frontend/calibration/row_field.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {

// What a run has found out about the calibration of its cameras.
struct RigFindings {
  std::optional<PairAlignment> alignment;  // taken out of the right images; none: nothing was
  RowField rows;                           // of the stereo matches, after that
  double disparity_offset = 0;             // in use [px]; 0: none is shown
  double disparity_sigma = 0;              // of what is known of it
  double median_disparity = 0;             // of the last frame [px]
  std::optional<FoundParameter> disparity, shading;  // all that is known; none: nothing yet
  RigCorrection of_map;                              // with which the run began
  // Where what this run shows contradicts that: the rig is another one now.
  struct {
    bool rows = false, disparity = false, shading = false;
  } changed;
};

// Follows the residuals of a run and says what lies under the noise of the keypoints; see
// NoiseFloor. By the map alone, at stated numbers of keyframes: each time it has doubled since the
// last look, from kFirst on, and every kMost later. One thread.
class FloorFinder {
 public:
  static constexpr std::size_t kFirst = 8;
  static constexpr std::size_t kMost = 128;  // keyframes that are looked at, the newest

  explicit FloorFinder(CameraId camera) : camera_(camera) {}

  // Whether there is another floor now.
  bool follow(const MapSnapshot& map);

  // Null where nothing is systematic.
  const std::shared_ptr<const NoiseFloor>& floor() const { return floor_; }

 private:
  CameraId camera_;
  std::size_t next_ = kFirst;
  std::shared_ptr<const NoiseFloor> floor_;
};

// Of the systematic part of a map's residuals; null where it could be an accident. An observation
// has one standard deviation for both its images: that of the disparity counts where it is larger,
// by half its variance.
std::shared_ptr<const NoiseFloor> floor_of(const ResidualMap& residuals);

// The rows of the matches.
void add_rows(const StereoFeatures& features, RowField& rows);

// Error of the scale beyond which a rig is to be calibrated again.
inline constexpr double kDoubtfulScale = 0.01;

// Of the left keypoints with a right match [px]; 0 without any.
double median_disparity(const FeatureSet& left, const std::vector<float>& u_right);

// Median of the absolute differences of the matches' rows [px], of small keypoints; none without
// matches. The matcher takes none that are farther apart than StereoMatcherOptions allow: of larger
// errors there are hardly any matches.
std::optional<double> row_error(const StereoFeatures& features);

}  // namespace hybrid_slam
