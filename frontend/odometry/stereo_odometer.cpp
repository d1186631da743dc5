#include "frontend/odometry/stereo_odometer.h"

#include <stdexcept>
#include <utility>

#include "frontend/pose/independent_patches.h"

namespace hybrid_slam {
namespace {

StereoCorrespondence correspondence(const StereoFeatures& previous, const StereoFeatures& current,
                                    const CircularMatch& match) {
  const auto i = static_cast<std::size_t>(match.previous);
  const auto j = static_cast<std::size_t>(match.current);
  const Keypoint& before = previous.left.keypoints[i];
  const Keypoint& left = current.left.keypoints[j];
  const int right = current.right_of_left[j];
  const float v_right =
      right >= 0 ? current.right.keypoints[static_cast<std::size_t>(right)].y : left.y;
  return {{before.x, before.y, previous.u_right[i]},
          {left.x, left.y, current.u_right[j], v_right},
          before.sigma,
          left.sigma};
}

}  // namespace

StereoOdometer::StereoOdometer(const Calibrated<RectifiedStereo>& camera,
                               const StereoOdometerOptions& options)
    : camera_(camera), options_(options) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument("stereo odometer: " + error);
}

std::optional<StereoMotion> StereoOdometer::estimate(const StereoFeatures& previous,
                                                     const StereoFeatures& current) const {
  const std::vector<CircularMatch> matches = match_circular(previous, current, {});
  std::vector<StereoCorrespondence> correspondences;
  correspondences.reserve(matches.size());
  for (const CircularMatch& match : matches) {
    correspondences.push_back(correspondence(previous, current, match));
  }
  const auto solution = solve_stereo_motion(camera_, correspondences, options_);
  if (!solution) return std::nullopt;
  StereoMotion motion;
  motion.current_from_previous = solution->current_from_previous;
  motion.covariance = solution->covariance;
  motion.matches = static_cast<int>(matches.size());
  auto inlier = solution->inliers.begin();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const bool agrees = inlier != solution->inliers.end() && static_cast<std::size_t>(*inlier) == i;
    if (agrees) ++inlier;
    (agrees ? motion.inliers : motion.outliers).push_back(matches[i]);
  }
  motion.support = support(motion, previous);
  return motion;
}

PoseSupport StereoOdometer::support(const StereoMotion& motion,
                                    const StereoFeatures& previous) const {
  std::vector<double> depths;
  std::vector<Keypoint> all, agreeing;
  for (const CircularMatch& match : motion.outliers) {
    all.push_back(previous.left.keypoints[static_cast<std::size_t>(match.previous)]);
  }
  for (const CircularMatch& match : motion.inliers) {
    const auto i = static_cast<std::size_t>(match.previous);
    const Keypoint& before = previous.left.keypoints[i];
    const auto point = triangulate_stereo(camera_, {before.x, before.y, previous.u_right[i]});
    if (point) depths.push_back(point->norm());
    agreeing.push_back(before);
  }
  all.insert(all.end(), agreeing.begin(), agreeing.end());
  const double area = static_cast<double>(camera_.width) * camera_.height;
  return {.candidates = count_independent(std::move(all)),
          .inliers = static_cast<int>(motion.inliers.size()),
          .evidence = count_independent(std::move(agreeing)),
          .chance = chance_in_area(options_.inlier_threshold, 1, area),
          .covariance = motion.covariance,
          .depth = median_of(std::move(depths))};
}

}  // namespace hybrid_slam
