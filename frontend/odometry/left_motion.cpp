#include "frontend/odometry/left_motion.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "backend/map/frame_observations.h"
#include "frontend/matching/brute_force.h"
#include "frontend/matching/optical_flow.h"
#include "frontend/pose/independent_patches.h"
#include "frontend/pose/pnp_ransac.h"
#include "frontend/pose/pose_refinement.h"

namespace hybrid_slam {
namespace {

// Of wrong matches: those of blurred images are mostly wrong. One right sample in 1000 is found
// with 63 %, at a share of 10 %.
constexpr PnpRansacOptions kRansac{.confidence = 0.999, .max_iterations = 1000, .min_inliers = 4};
constexpr double kRatio = 0.85;       // best against second best descriptor
constexpr double kPatchSigma = 0.7;   // [px] of a followed patch, within what follow_patches allows
constexpr float kPatchDistance = 10;  // [px] between patches

// A point of the previous frame, and where the current one shows it.
struct LeftMatch {
  int previous = 0;
  int current = -1;   // keypoint; -1: none, a patch
  Keypoint keypoint;  // the previous one
  Eigen::Vector3d in_previous;
  double current_sigma = 1;
  Eigen::Vector3d measurement;  // (u, v, u_right or NaN)
};

// The error of the earlier disparity moves the point along its ray, which shows by as much as the
// camera moves, in baselines.
std::vector<PoseObservation> observations(const std::vector<LeftMatch>& matches,
                                          double motion_in_baselines) {
  std::vector<PoseObservation> result;
  result.reserve(matches.size());
  for (const LeftMatch& match : matches) {
    const double before = match.keypoint.sigma * std::hypot(1.0, motion_in_baselines);
    result.push_back(
        {match.in_previous, match.measurement, std::hypot(before, match.current_sigma)});
  }
  return result;
}

// Squares of the residuals give the level of the noise, and the threshold has cut off some of them.
Matrix6d covariance(const PoseRefinementResult& refined) {
  const double efficiency = inlier_efficiency(2, PoseRefinementOptions().chi2_mono);
  const double freedom = 2.0 * refined.inliers;
  const double level =
      refined.rms * refined.rms / (efficiency * efficiency) * freedom / std::max(freedom - 8, 1.0);
  return level * covariance_of_information(refined.information);
}

// Patches keep a distance from one another, each tells something of its own; descriptors may not.
int count_evidence(const std::vector<LeftMatch>& matches) {
  int patches = 0;
  std::vector<Keypoint> described;
  for (const LeftMatch& match : matches) {
    if (match.current < 0) {
      ++patches;
    } else {
      described.push_back(match.keypoint);
    }
  }
  return patches + count_independent(std::move(described));
}

// `lost`: patches that were looked for, and gave no match.
std::optional<StereoMotion> solve(const Calibrated<RectifiedStereo>& camera,
                                  const std::vector<LeftMatch>& matches, std::size_t lost) {
  const auto pnp =
      solve_pnp_ransac(bearing_observations(camera, observations(matches, 0)), kRansac);
  if (!pnp) return std::nullopt;
  const double moved = origin_in_a(pnp->cam_from_world).norm() / camera.params[4];
  const auto seen = observations(matches, moved);
  const PoseRefinementOptions options{.first_scale = 4};  // most matches are wrong, the pose is not
  const PoseRefinementResult refined = refine_pose(camera, pnp->cam_from_world, seen, options);
  StereoMotion motion;
  motion.current_from_previous = refined.cam_from_world;
  motion.covariance = covariance(refined);
  motion.matches = static_cast<int>(matches.size() + lost);
  std::vector<double> depths;
  std::vector<LeftMatch> agreeing;
  const double area = static_cast<double>(camera.width) * camera.height;
  const double reached = std::min(area, 4.0 * kFlowReach * kFlowReach);
  double chance = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    chance +=
        chance_in_area(seen[i].sigma, options.chi2_mono, matches[i].current >= 0 ? area : reached);
    if (!refined.inlier[i]) continue;
    depths.push_back(matches[i].in_previous.norm());
    agreeing.push_back(matches[i]);
    if (matches[i].current >= 0) {
      motion.inliers.push_back({matches[i].previous, matches[i].current});
    } else {
      ++motion.patches;
    }
  }
  if (!motion.covariance.allFinite()) return std::nullopt;
  motion.support = {.candidates = count_evidence(matches) + static_cast<int>(lost),
                    .inliers = refined.inliers,
                    .evidence = count_evidence(agreeing),
                    .chance = chance / static_cast<double>(matches.size()),
                    .covariance = motion.covariance,
                    .depth = median_of(std::move(depths))};
  return motion;
}

// The earlier keypoints that have a depth.
struct Points {
  FeatureSet features;
  std::vector<int> index;
  std::vector<Eigen::Vector3d> in_previous;
};

Points points_of(const Calibrated<RectifiedStereo>& camera, const StereoFeatures& previous) {
  Points points;
  points.features.kind = previous.left.kind;
  for (std::size_t i = 0; i < previous.left.size(); ++i) {
    const Keypoint& keypoint = previous.left.keypoints[i];
    if (std::isnan(previous.u_right[i])) continue;
    const auto point = triangulate_stereo(camera, {keypoint.x, keypoint.y, previous.u_right[i]});
    if (!point) continue;
    points.features.keypoints.push_back(keypoint);
    points.features.descriptors.push_back(previous.left.descriptors[i]);
    points.index.push_back(static_cast<int>(i));
    points.in_previous.push_back(*point);
  }
  return points;
}

// Those that keep a distance from one another, the strongest first: indices into `points`.
std::vector<std::size_t> spread(const Points& points) {
  std::vector<std::size_t> order(points.index.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return points.features.keypoints[a].response > points.features.keypoints[b].response;
  });
  std::set<std::pair<int, int>> taken;
  std::vector<std::size_t> kept;
  for (const std::size_t i : order) {
    const Keypoint& k = points.features.keypoints[i];
    if (taken
            .emplace(static_cast<int>(k.x / kPatchDistance), static_cast<int>(k.y / kPatchDistance))
            .second) {
      kept.push_back(i);
    }
  }
  return kept;
}

}  // namespace

std::optional<StereoMotion> motion_by_left_matches(const Calibrated<RectifiedStereo>& camera,
                                                   const StereoFeatures& previous,
                                                   const StereoFeatures& current) {
  const Points points = points_of(camera, previous);
  if (points.features.kind != current.left.kind) return std::nullopt;
  const BruteForceOptions brute_force{.ratio = kRatio};
  std::vector<LeftMatch> matches;
  for (const DescriptorMatch& found :
       match_brute_force(points.features, current.left, brute_force)) {
    const auto i = static_cast<std::size_t>(found.query);
    const auto j = static_cast<std::size_t>(found.train);
    const Keypoint& now = current.left.keypoints[j];
    matches.push_back({points.index[i],
                       found.train,
                       points.features.keypoints[i],
                       points.in_previous[i],
                       now.sigma,
                       {now.x, now.y, current.u_right[j]}});
  }
  return solve(camera, matches, 0);
}

std::optional<StereoMotion> motion_by_patches(const Calibrated<RectifiedStereo>& camera,
                                              const StereoFeatures& previous,
                                              const ImagePyramid& previous_image,
                                              const ImagePyramid& current_image) {
  const Points points = points_of(camera, previous);
  const std::vector<std::size_t> followed = spread(points);
  std::vector<Eigen::Vector2f> starts;
  for (const std::size_t i : followed) {
    const Keypoint& keypoint = points.features.keypoints[i];
    starts.emplace_back(keypoint.x, keypoint.y);
  }
  std::vector<LeftMatch> matches;
  for (const FlowMatch& flow : follow_patches(previous_image, current_image, starts)) {
    const std::size_t i = followed[static_cast<std::size_t>(flow.point)];
    matches.push_back({points.index[i],
                       -1,
                       points.features.keypoints[i],
                       points.in_previous[i],
                       kPatchSigma,
                       {flow.position.x(), flow.position.y(), kNoRightMatch}});
  }
  return solve(camera, matches, followed.size() - matches.size());
}

}  // namespace hybrid_slam
