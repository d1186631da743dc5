#include "frontend/matching/stereo_matcher.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "backend/map/frame_observations.h"
#include "frontend/matching/descriptor_distance.h"

namespace hybrid_slam {
namespace {

// The band's growth with the keypoints' standard deviations. Measured with the default options: a
// band of 1.5 to 2 px finds 99 % of the true matches of a band of 3 px on KITTI and a third fewer
// wrong ones.
constexpr double kRowSigmas = 1;
// The second best must be another place than the best, not its other orientation [px].
constexpr float kSamePlace = 1.5F;

// The keypoints of one image ordered by row.
class Rows {
 public:
  explicit Rows(const std::vector<Keypoint>& keypoints) : keypoints_(keypoints) {
    order_.resize(keypoints.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) { return y(a) < y(b); });
    for (const Keypoint& k : keypoints) max_sigma_ = std::max(max_sigma_, double{k.sigma});
  }

  double max_sigma() const { return max_sigma_; }

  // The keypoints with y in [low, high], by row.
  std::span<const int> between(double low, double high) const {
    const auto begin =
        std::partition_point(order_.begin(), order_.end(), [&](int i) { return y(i) < low; });
    const auto end = std::partition_point(begin, order_.end(), [&](int i) { return y(i) <= high; });
    return {begin, end};
  }

 private:
  double y(int i) const { return keypoints_[static_cast<std::size_t>(i)].y; }

  const std::vector<Keypoint>& keypoints_;
  std::vector<int> order_;
  double max_sigma_ = 0;
};

struct RowMatch {
  int index = -1;
  std::int32_t distance = -1;  // squared, of the bytes
  std::int32_t second = -1;    // at another place
};

class RowMatcher {
 public:
  RowMatcher(const FeatureSet& left, const FeatureSet& right, double max_disparity,
             const StereoMatcherOptions& options)
      : left_(left), right_(right), max_disparity_(max_disparity), options_(options) {}

  std::vector<int> match() {
    const Rows rows(right_.keypoints);
    std::vector<RowMatch> best_right(left_.size());
    std::vector<RowMatch> best_left(right_.size());
    for (std::size_t i = 0; i < left_.size(); ++i) {
      find_candidates(left_.keypoints[i], rows);
      distances_.resize(candidates_.size());
      squared_distances(left_.descriptors[i], right_.descriptors, candidates_, distances_);
      best_right[i] = choose(candidates_, distances_);
      for (std::size_t k = 0; k < candidates_.size(); ++k) {
        RowMatch& best = best_left[static_cast<std::size_t>(candidates_[k])];
        if (best.index < 0 || distances_[k] < best.distance) {
          best = {static_cast<int>(i), distances_[k], -1};
        }
      }
    }
    return keep_mutual(best_right, best_left);
  }

 private:
  void find_candidates(const Keypoint& left, const Rows& rows) {
    const auto band = [&](double right_sigma) {
      return options_.max_row_difference + kRowSigmas * std::hypot(double{left.sigma}, right_sigma);
    };
    const double widest = band(rows.max_sigma());
    candidates_.clear();
    for (const int j : rows.between(left.y - widest, left.y + widest)) {
      const Keypoint& right = right_.keypoints[static_cast<std::size_t>(j)];
      const double disparity = double{left.x} - right.x;
      if (!(disparity >= options_.min_disparity && disparity <= max_disparity_)) continue;
      if (std::abs(double{left.y} - right.y) > band(right.sigma)) continue;
      const double scale_ratio = double{left.scale} / right.scale;
      if (std::max(scale_ratio, 1 / scale_ratio) > options_.max_scale_ratio) continue;
      candidates_.push_back(j);
    }
  }

  bool same_place(int a, int b) const {
    const Keypoint& p = right_.keypoints[static_cast<std::size_t>(a)];
    const Keypoint& q = right_.keypoints[static_cast<std::size_t>(b)];
    return std::hypot(p.x - q.x, p.y - q.y) < kSamePlace;
  }

  // Ties go to the lower index.
  RowMatch choose(const std::vector<int>& candidates,
                  const std::vector<std::int32_t>& distances) const {
    RowMatch best;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const bool tie = distances[k] == best.distance && candidates[k] < best.index;
      if (best.index >= 0 && distances[k] >= best.distance && !tie) continue;
      best.index = candidates[k];
      best.distance = distances[k];
    }
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      if (same_place(candidates[k], best.index)) continue;
      if (best.second < 0 || distances[k] < best.second) best.second = distances[k];
    }
    return best;
  }

  std::vector<int> keep_mutual(const std::vector<RowMatch>& best_right,
                               const std::vector<RowMatch>& best_left) const {
    const std::int32_t max_distance = to_squared_bytes(options_.max_descriptor_distance);
    std::vector<int> right_of_left(left_.size(), -1);
    for (std::size_t i = 0; i < left_.size(); ++i) {
      const RowMatch& best = best_right[i];
      if (best.index < 0 || best.distance > max_distance) continue;
      if (!passes_ratio(best.distance, best.second, options_.ratio)) continue;
      if (best_left[static_cast<std::size_t>(best.index)].index != static_cast<int>(i)) continue;
      right_of_left[i] = best.index;
    }
    return right_of_left;
  }

  const FeatureSet& left_;
  const FeatureSet& right_;
  double max_disparity_;
  const StereoMatcherOptions& options_;
  std::vector<int> candidates_;  // of the feature at hand
  std::vector<std::int32_t> distances_;
};

// The right image's column of a left keypoint, from `u_right`; kNoRightMatch if the patches differ.
float refine(const Keypoint& left, float u_right, const ImagePyramid& left_image,
             const ImagePyramid& right_image, const StereoMatcherOptions& options) {
  const std::optional<ReferencePatch> patch =
      make_reference_patch(left_image, left.x, left.y, left.scale, options.alignment);
  if (!patch) return u_right;
  const Alignment alignment = align_patch(*patch, right_image, Eigen::Matrix2d::Identity(),
                                          {u_right, left.y}, options.alignment);
  if (!alignment.converged) return kNoRightMatch;
  if (left.x - alignment.position.x() < options.min_disparity) return kNoRightMatch;
  return static_cast<float>(alignment.position.x());
}

}  // namespace

std::string StereoMatcherOptions::validate() const {
  if (!(max_row_difference >= 0)) return "max_row_difference must not be negative";
  if (!(min_disparity > 0)) return "min_disparity must be positive";
  if (!(min_depth > 0)) return "min_depth must be positive";
  if (!(max_scale_ratio >= 1)) return "max_scale_ratio must not be below 1";
  if (!(max_descriptor_distance > 0)) return "max_descriptor_distance must be positive";
  if (!(ratio > 0 && ratio <= 1)) return "ratio must lie in (0, 1]";
  const std::string error = alignment.validate();
  return error.empty() ? error : "alignment: " + error;
}

StereoFeatures match_stereo(FeatureSet left, FeatureSet right, const ImagePyramid* left_image,
                            const ImagePyramid* right_image,
                            const Calibrated<RectifiedStereo>& camera,
                            const StereoMatcherOptions& options) {
  if (left.size() > 0 && right.size() > 0 && left.kind != right.kind) {
    throw std::logic_error("descriptors of different kinds");
  }
  StereoFeatures features;
  features.left = std::move(left);
  features.right = std::move(right);
  const double max_disparity = camera.params[0] / options.min_depth;  // fx
  features.right_of_left =
      RowMatcher(features.left, features.right, max_disparity, options).match();
  features.u_right.assign(features.left.size(), kNoRightMatch);
  for (std::size_t i = 0; i < features.left.size(); ++i) {
    int& right_index = features.right_of_left[i];
    if (right_index < 0) continue;
    float u_right = features.right.keypoints[static_cast<std::size_t>(right_index)].x;
    if (options.refine && left_image && right_image) {
      u_right = refine(features.left.keypoints[i], u_right, *left_image, *right_image, options);
    }
    if (std::isnan(u_right)) {
      right_index = -1;
    } else {
      features.u_right[i] = u_right;
    }
  }
  return features;
}

}  // namespace hybrid_slam
