#include "frontend/calibration/rig_calibrator.h"

#include <algorithm>
#include <cmath>

#include "frontend/matching/pair_check.h"

namespace hybrid_slam {
namespace {

constexpr double kAccident = 4.75;  // once in a million: standard deviations, one-sided

// Of values in any order, not empty.
double middle_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// take(left, right): of each match of small keypoints. The others' places are coarse.
template <typename Take>
void for_small_matches(const StereoFeatures& features, const Take& take) {
  for (std::size_t i = 0; i < features.right_of_left.size(); ++i) {
    if (features.right_of_left[i] < 0) continue;
    const Keypoint& left = features.left.keypoints[i];
    const Keypoint& right =
        features.right.keypoints[static_cast<std::size_t>(features.right_of_left[i])];
    if (std::max(left.scale, right.scale) <= PairCheck::kSmall) take(left, right);
  }
}

}  // namespace

std::shared_ptr<const NoiseFloor> floor_of(const ResidualMap& residuals) {
  const SystematicPart part = systematic_part(residuals);
  if (!(part.significance > kAccident)) return nullptr;
  std::vector<double> variance(residuals.cells.size());
  for (std::size_t i = 0; i < variance.size(); ++i) {
    variance[i] = std::max(part.image[i], part.disparity[i] / 2);
  }
  return std::make_shared<const NoiseFloor>(residuals.cells, std::move(variance));
}

bool FloorFinder::follow(const MapSnapshot& map) {
  const std::size_t keyframes = map.keyframe_count();
  if (keyframes < next_) return false;
  while (next_ <= keyframes) next_ += std::min(next_, kMost);
  auto found = floor_of(residual_map(map, camera_, kMost));
  const bool changed = found != nullptr || floor_ != nullptr;
  floor_ = std::move(found);
  return changed;
}

void add_rows(const StereoFeatures& features, RowField& rows) {
  for_small_matches(features, [&](const Keypoint& left, const Keypoint& right) {
    rows.add(left.x, left.y, double{left.y} - right.y);
  });
}

std::optional<double> row_error(const StereoFeatures& features) {
  std::vector<double> errors;
  for_small_matches(features, [&](const Keypoint& left, const Keypoint& right) {
    errors.push_back(std::abs(double{left.y} - right.y));
  });
  if (errors.empty()) return std::nullopt;
  return middle_of(errors);
}

double median_disparity(const FeatureSet& left, const std::vector<float>& u_right) {
  std::vector<double> disparities;
  for (std::size_t i = 0; i < u_right.size(); ++i) {
    if (!std::isnan(u_right[i])) disparities.push_back(double{left.keypoints[i].x} - u_right[i]);
  }
  return disparities.empty() ? 0 : middle_of(disparities);
}

}  // namespace hybrid_slam
