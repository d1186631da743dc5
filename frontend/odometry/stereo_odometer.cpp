#include "frontend/odometry/stereo_odometer.h"

#include <stdexcept>

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
  return motion;
}

}  // namespace hybrid_slam
