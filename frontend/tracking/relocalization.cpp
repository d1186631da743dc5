#include "frontend/tracking/relocalization.h"

#include <algorithm>
#include <cmath>

#include "frontend/matching/brute_force.h"
#include "frontend/place_recognition/guided_matching.h"
#include "frontend/pose/independent_patches.h"

namespace hybrid_slam {
namespace {

// Optimises the pose and drops the landmarks that do not agree with it.
int refine_and_prune(const MapSnapshot& map, const FeatureView& view,
                     const PoseRefinementOptions& options, RelocalizedFrame& frame) {
  std::vector<std::size_t> keypoint;
  const auto observations =
      pose_observations(map, view.features, view.u_right, frame.landmarks, keypoint);
  const auto refined = refine_pose(view.camera, frame.cam_from_world, observations, options);
  frame.cam_from_world = refined.cam_from_world;
  frame.inliers = refined.inliers;
  frame.covariance = covariance_of_information(refined.information);
  std::vector<double> depths;
  for (std::size_t i = 0; i < keypoint.size(); ++i) {
    if (!refined.inlier[i]) {
      frame.landmarks[keypoint[i]] = LandmarkId();
    } else {
      depths.push_back((frame.cam_from_world * observations[i].point_in_world).norm());
    }
  }
  frame.depth = median_of(std::move(depths));
  return frame.inliers;
}

// Searches the landmarks of the keyframe and its neighbours inside windows around their
// projections.
void search_around(const MapSnapshot& map, const FeatureView& view,
                   ProjectionMatcherOptions matcher, double radius, RelocalizedFrame& frame) {
  std::vector<LandmarkId> ids;
  const auto append = [&](KeyframeId keyframe) {
    for (const LandmarkId id : map.at(keyframe).landmarks) {
      if (id.valid()) {
        ids.push_back(id);
      }
    }
  };
  append(frame.keyframe);
  for (const Covisible& covisible : map.covisible(frame.keyframe, 15, 10)) {
    append(covisible.id);
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  std::vector<char> taken(view.features.size(), 0);
  for (std::size_t i = 0; i < frame.landmarks.size(); ++i) {
    if (frame.landmarks[i].valid()) {
      taken[i] = 1;
      const auto found = std::lower_bound(ids.begin(), ids.end(), frame.landmarks[i]);
      if (found != ids.end() && *found == frame.landmarks[i]) {
        ids.erase(found);
      }
    }
  }
  matcher.radius = radius;
  const auto predictions =
      predict_landmarks(map, view.camera, frame.cam_from_world, ids, matcher.max_view_angle_deg);
  for (const ProjectionMatch& match : match_predictions(map, view, predictions, &taken, matcher)) {
    frame.landmarks[static_cast<std::size_t>(match.keypoint)] = match.landmark;
  }
}

// The matches were looked for all over the image.
PoseSupport support_of(const PnpResult& pnp, const std::vector<PoseObservation>& observations,
                       const std::vector<std::size_t>& keypoint, const FeatureView& view,
                       const PoseRefinementOptions& options) {
  const double area = static_cast<double>(image_width(view.camera)) * image_height(view.camera);
  double chances = 0;
  std::vector<Keypoint> all, agreeing;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    chances += chance_in_area(observations[i].sigma, options.chi2_mono, area);
    all.push_back(view.features.keypoints[keypoint[i]]);
    if (pnp.inlier[i]) agreeing.push_back(all.back());
  }
  return {.candidates = count_independent(std::move(all)),
          .inliers = pnp.inliers,
          .evidence = count_independent(std::move(agreeing)),
          .chance = chances / static_cast<double>(observations.size())};
}

std::optional<RelocalizedFrame> try_keyframe(const MapSnapshot& map, const FeatureView& view,
                                             KeyframeId id, const std::vector<LandmarkId>& matched,
                                             const ProjectionMatcherOptions& matcher,
                                             const PoseRefinementOptions& pose,
                                             const RelocalizationOptions& options) {
  std::vector<std::size_t> keypoint;
  const auto observations = pose_observations(map, view.features, view.u_right, matched, keypoint);
  const auto pnp =
      solve_pnp_ransac(bearing_observations(view.camera, observations), options.ransac);
  if (!pnp || !is_no_accident(support_of(*pnp, observations, keypoint, view, pose))) {
    return std::nullopt;
  }
  RelocalizedFrame frame{.cam_from_world = pnp->cam_from_world,
                         .keyframe = id,
                         .landmarks = std::vector<LandmarkId>(view.features.size())};
  for (std::size_t i = 0; i < keypoint.size(); ++i) {
    if (pnp->inlier[i]) {
      frame.landmarks[keypoint[i]] = matched[keypoint[i]];
    }
  }
  if (refine_and_prune(map, view, pose, frame) < options.ransac.min_inliers) {
    return std::nullopt;
  }
  for (const double radius : {options.wide_radius, options.narrow_radius}) {
    search_around(map, view, matcher, radius, frame);
    refine_and_prune(map, view, pose, frame);
  }
  if (!is_certain(frame.covariance, frame.depth)) {
    return std::nullopt;
  }
  return frame;
}

}  // namespace

std::string RelocalizationOptions::validate() const {
  if (max_keyframes < 0 || min_matches < 0 || min_inliers < 0) {
    return "relocalization: max_keyframes, min_matches and min_inliers must not be negative";
  }
  if (!(ratio > 0 && ratio <= 1)) return "relocalization: ratio must lie in (0, 1]";
  if (!(max_descriptor_distance > 0) || !(wide_radius > 0) || !(narrow_radius > 0)) {
    return "relocalization: max_descriptor_distance and radii must be positive";
  }
  if (!(ransac.confidence > 0 && ransac.confidence < 1) || ransac.max_iterations < 1) {
    return "relocalization: ransac: confidence must lie in (0, 1), max_iterations be positive";
  }
  return {};
}

std::vector<LandmarkId> match_keyframe(const MapSnapshot& map, KeyframeId keyframe,
                                       const FeatureSet& features, double ratio,
                                       double max_descriptor_distance) {
  const Keyframe& reference = map.at(keyframe);
  const FeatureSet& stored = reference.observations->features;
  std::vector<LandmarkId> result(features.size());
  if (stored.kind != features.kind) {
    return result;  // descriptors of different kinds say nothing about one another
  }
  std::vector<LandmarkId> ids;
  FeatureSet with_landmark;
  with_landmark.kind = stored.kind;
  for (std::size_t i = 0; i < reference.landmarks.size(); ++i) {
    if (reference.landmarks[i].valid()) {
      ids.push_back(reference.landmarks[i]);
      with_landmark.keypoints.push_back(stored.keypoints[i]);
      with_landmark.descriptors.push_back(stored.descriptors[i]);
    }
  }
  BruteForceOptions options;
  options.ratio = ratio;
  options.max_descriptor_distance = max_descriptor_distance;
  for (const DescriptorMatch& match : match_brute_force(with_landmark, features, options)) {
    result[static_cast<std::size_t>(match.train)] = ids[static_cast<std::size_t>(match.query)];
  }
  return result;
}

std::vector<LandmarkId> match_keyframe_guided(const MapSnapshot& map, KeyframeId keyframe,
                                              const DirectIndex& keyframe_index,
                                              const FeatureSet& features, const DirectIndex& index,
                                              double ratio, double max_descriptor_distance) {
  const Keyframe& reference = map.at(keyframe);
  const auto landmark_of = [&](int feature) {
    return reference.landmarks[static_cast<std::size_t>(feature)];
  };
  BruteForceOptions options;
  options.ratio = ratio;
  options.max_descriptor_distance = max_descriptor_distance;
  std::vector<LandmarkId> result(features.size());
  for (const DescriptorMatch& match :
       match_guided(reference.observations->features, keyframe_index, features, index, options)) {
    result[static_cast<std::size_t>(match.train)] = landmark_of(match.query);
  }
  return result;
}

std::vector<PoseObservation> pose_observations(const MapSnapshot& map, const FeatureSet& features,
                                               const std::vector<float>& u_right,
                                               const std::vector<LandmarkId>& landmarks,
                                               std::vector<std::size_t>& keypoint) {
  std::vector<PoseObservation> observations;
  keypoint.clear();
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const Landmark* landmark = landmarks[i].valid() ? map.find(landmarks[i]) : nullptr;
    if (landmark == nullptr) {
      continue;
    }
    const Keypoint& measured = features.keypoints[i];
    observations.push_back({landmark->point_in_world,
                            {measured.x, measured.y, u_right.empty() ? kNoRightMatch : u_right[i]},
                            measured.sigma});
    keypoint.push_back(i);
  }
  return observations;
}

std::vector<KeyframeId> newest_keyframes(const MapSnapshot& map, int count) {
  std::vector<KeyframeId> ids = map.keyframe_ids();
  std::reverse(ids.begin(), ids.end());
  ids.resize(std::min(ids.size(), static_cast<std::size_t>(count)));
  return ids;
}

std::optional<RelocalizedFrame> relocalize(const MapSnapshot& map, const FeatureView& view,
                                           std::span<const KeyframeId> keyframes,
                                           const KeyframeMatcher& match,
                                           const ProjectionMatcherOptions& matcher,
                                           const PoseRefinementOptions& pose,
                                           const RelocalizationOptions& options) {
  for (const KeyframeId keyframe : keyframes) {
    if (map.find(keyframe) == nullptr) {
      continue;
    }
    auto found = try_keyframe(map, view, keyframe, match(keyframe), matcher, pose, options);
    if (found) {
      return found;
    }
  }
  return std::nullopt;
}

}  // namespace hybrid_slam
