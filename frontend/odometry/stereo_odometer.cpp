#include "frontend/odometry/stereo_odometer.h"

#include <stdexcept>
#include <utility>

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
  for (const int i : solution->inliers) {
    motion.inliers.push_back(matches[static_cast<std::size_t>(i)]);
  }
  motion.support = support(motion, previous);
  return motion;
}

PoseSupport StereoOdometer::support(const StereoMotion& motion,
                                    const StereoFeatures& previous) const {
  std::vector<double> depths;
  for (const CircularMatch& match : motion.inliers) {
    const auto i = static_cast<std::size_t>(match.previous);
    const Keypoint& before = previous.left.keypoints[i];
    const auto point = triangulate_stereo(camera_, {before.x, before.y, previous.u_right[i]});
    if (point) depths.push_back(point->norm());
  }
  const double area = static_cast<double>(camera_.width) * camera_.height;
  return {.candidates = motion.matches,
          .inliers = static_cast<int>(motion.inliers.size()),
          .chance = chance_in_area(options_.inlier_threshold, 1, area),
          .covariance = motion.covariance,
          .depth = median_of(std::move(depths))};
}

}  // namespace hybrid_slam
