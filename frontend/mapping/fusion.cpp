#include "frontend/mapping/fusion.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "frontend/matching/projection_matcher.h"

namespace hybrid_slam {
namespace {

std::vector<KeyframeId> neighbours_of(const MapSnapshot& map, KeyframeId keyframe,
                                      const FusionOptions& options) {
  std::vector<KeyframeId> result;
  std::unordered_set<KeyframeId> seen{keyframe};
  for (const Covisible& first :
       map.covisible(keyframe, 15, static_cast<std::size_t>(options.neighbours))) {
    if (seen.insert(first.id).second) {
      result.push_back(first.id);
    }
    for (const Covisible& second :
         map.covisible(first.id, 15, static_cast<std::size_t>(options.second_neighbours))) {
      if (seen.insert(second.id).second) {
        result.push_back(second.id);
      }
    }
  }
  return result;
}

bool within_noise(const FrameObservations& observations, const ProjectionMatch& match,
                  const LandmarkPrediction& prediction, const FusionOptions& options) {
  const auto index = static_cast<std::size_t>(match.keypoint);
  const Keypoint& keypoint = observations.features.keypoints[index];
  const double variance = keypoint.sigma * keypoint.sigma;
  const double error = (prediction.pixel - Eigen::Vector2d(keypoint.x, keypoint.y)).squaredNorm();
  if (observations.has_right(index) && !std::isnan(prediction.u_right)) {
    const double right = prediction.u_right - observations.u_right[index];
    return error + right * right <= options.chi2_stereo * variance;
  }
  return error <= options.chi2_mono * variance;
}

// Looks for `landmarks` in a keyframe that does not see them yet.
void fuse_into(const MapSnapshot& map, KeyframeId id, const std::vector<LandmarkId>& landmarks,
               const FusionOptions& options, MapEdit& edit) {
  const Keyframe& keyframe = map.at(id);
  const FrameObservations& observations = *keyframe.observations;
  const Camera& camera = map.camera(keyframe);
  std::vector<LandmarkId> unseen;
  for (const LandmarkId landmark : landmarks) {
    const auto& seen_by = map.at(landmark).observations;
    const auto at = std::lower_bound(seen_by.begin(), seen_by.end(), Observation{id, 0});
    if (at == seen_by.end() || at->keyframe != id) {
      unseen.push_back(landmark);
    }
  }
  ProjectionMatcherOptions matcher;
  matcher.radius = options.radius;
  matcher.ratio = 1;
  matcher.max_descriptor_distance = options.max_descriptor_distance;
  matcher.max_scale_ratio = options.max_scale_ratio;
  const auto predictions =
      predict_landmarks(map, camera, keyframe.cam_from_world, unseen, matcher.max_view_angle_deg);
  const KeypointGrid grid(observations.features.keypoints, image_width(camera),
                          image_height(camera));
  const FeatureView view{camera, observations.features, observations.u_right, grid};
  std::unordered_map<LandmarkId, const LandmarkPrediction*> prediction_of;
  for (const LandmarkPrediction& prediction : predictions) {
    prediction_of.emplace(prediction.id, &prediction);
  }
  for (const ProjectionMatch& match : match_predictions(map, view, predictions, nullptr, matcher)) {
    if (!within_noise(observations, match, *prediction_of.at(match.landmark), options)) {
      continue;
    }
    const LandmarkId present = keyframe.landmarks[static_cast<std::size_t>(match.keypoint)];
    if (!present.valid()) {
      edit.new_observations.push_back(
          {match.landmark, {id, static_cast<std::uint32_t>(match.keypoint)}});
      continue;
    }
    const bool keep_present =
        map.at(present).observations.size() > map.at(match.landmark).observations.size();
    edit.merged.push_back(keep_present ? LandmarkMerge{present, match.landmark}
                                       : LandmarkMerge{match.landmark, present});
  }
}

void append_landmarks(const MapSnapshot& map, KeyframeId id, std::vector<LandmarkId>& ids) {
  for (const LandmarkId landmark : map.at(id).landmarks) {
    if (landmark.valid()) {
      ids.push_back(landmark);
    }
  }
}

template <typename Id>
void sort_unique(std::vector<Id>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

}  // namespace

std::string FusionOptions::validate() const {
  if (neighbours < 0 || second_neighbours < 0) {
    return "fusion: neighbours and second_neighbours must not be negative";
  }
  if (!(radius > 0) || !(max_descriptor_distance > 0)) {
    return "fusion: radius and max_descriptor_distance must be positive";
  }
  if (!(max_scale_ratio >= 1)) return "fusion: max_scale_ratio must not be below 1";
  if (!(chi2_mono > 0) || !(chi2_stereo > 0)) return "fusion: chi2 thresholds must be positive";
  return {};
}

MapEdit fuse_with_neighbours(const MapSnapshot& map, KeyframeId keyframe,
                             const FusionOptions& options) {
  MapEdit edit;
  std::vector<LandmarkId> own;
  append_landmarks(map, keyframe, own);
  std::vector<LandmarkId> theirs;
  for (const KeyframeId neighbour : neighbours_of(map, keyframe, options)) {
    fuse_into(map, neighbour, own, options, edit);
    append_landmarks(map, neighbour, theirs);
  }
  sort_unique(theirs);
  fuse_into(map, keyframe, theirs, options, edit);
  return edit;
}

MapEdit fuse_places(const MapSnapshot& map, KeyframeId a, KeyframeId b,
                    const FusionOptions& options) {
  std::vector<KeyframeId> keyframes;
  std::vector<LandmarkId> landmarks;
  for (const KeyframeId end : {a, b}) {
    keyframes.push_back(end);
    for (const Covisible& near :
         map.covisible(end, 15, static_cast<std::size_t>(options.neighbours))) {
      keyframes.push_back(near.id);
    }
  }
  sort_unique(keyframes);
  for (const KeyframeId id : keyframes) append_landmarks(map, id, landmarks);
  sort_unique(landmarks);
  MapEdit edit;
  for (const KeyframeId id : keyframes) fuse_into(map, id, landmarks, options, edit);
  return edit;
}

}  // namespace hybrid_slam
