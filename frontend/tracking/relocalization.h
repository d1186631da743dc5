#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "frontend/matching/projection_matcher.h"
#include "frontend/place_recognition/image_words.h"
#include "frontend/pose/pnp_ransac.h"
#include "frontend/pose/pose_belief.h"
#include "frontend/pose/pose_refinement.h"

namespace hybrid_slam {

struct RelocalizationOptions {
  int max_keyframes = 20;  // the most similar ones, where nothing else is known
  double ratio = 0.75;     // best against second best descriptor
  double max_descriptor_distance = 0.7;
  int min_matches = 15;      // no effect: see is_believed()
  int min_inliers = 50;      // of a stereo pair, in the local map; no effect of a fisheye
  double wide_radius = 10;   // [px]
  double narrow_radius = 3;  // [px]
  PnpRansacOptions ransac{.min_inliers = 6};

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

struct RelocalizedFrame {
  Rigid3d cam_from_world;
  KeyframeId keyframe;                // the one it was found in
  std::vector<LandmarkId> landmarks;  // one per keypoint, inliers only
  int inliers = 0;
  Matrix6d covariance = PoseSupport().covariance;  // given the landmarks
  double depth = 0;                                // median distance of these [m]
};

// Descriptor matches between the landmarks of a keyframe and an image's features: one entry per
// keypoint, invalid where nothing matches. None of `landmarks` need be in view.
std::vector<LandmarkId> match_keyframe(const MapSnapshot& map, KeyframeId keyframe,
                                       const FeatureSet& features, double ratio,
                                       double max_descriptor_distance);

// The same, among features below the same node of the vocabulary: a fraction of the work, and most
// of the matches. The indices are those of all the keyframe's features and of the image's.
std::vector<LandmarkId> match_keyframe_guided(const MapSnapshot& map, KeyframeId keyframe,
                                              const DirectIndex& keyframe_index,
                                              const FeatureSet& features, const DirectIndex& index,
                                              double ratio, double max_descriptor_distance);

// Matches between the landmarks of a keyframe and the image, one entry per keypoint.
using KeyframeMatcher = std::function<std::vector<LandmarkId>(KeyframeId)>;

// What refine_pose needs, for the keypoints that have a landmark in the map; `keypoint` receives
// the index of each.
std::vector<PoseObservation> pose_observations(const MapSnapshot& map, const FeatureSet& features,
                                               const std::vector<float>& u_right,
                                               const std::vector<LandmarkId>& landmarks,
                                               std::vector<std::size_t>& keypoint);

// The newest keyframes, at most `count` of them, newest first.
std::vector<KeyframeId> newest_keyframes(const MapSnapshot& map, int count);

// Finds an image in the map without any prediction: `match` with one of `keyframes` after the
// other, PnP in RANSAC, guided search. None if no keyframe yields a pose to believe: agreement over
// the whole image that is no accident, and certain after guided search
// (frontend/pose/pose_belief.h). Ids that are not in the map are passed over.
std::optional<RelocalizedFrame> relocalize(const MapSnapshot& map, const FeatureView& view,
                                           std::span<const KeyframeId> keyframes,
                                           const KeyframeMatcher& match,
                                           const ProjectionMatcherOptions& matcher,
                                           const PoseRefinementOptions& pose,
                                           const RelocalizationOptions& options);

}  // namespace hybrid_slam
