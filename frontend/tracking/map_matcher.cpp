#include "frontend/tracking/map_matcher.h"

#include <algorithm>
#include <utility>

#include "frontend/pose/independent_patches.h"

namespace hybrid_slam {
namespace {

void assign(const std::vector<ProjectionMatch>& matches, Frame& frame) {
  for (const ProjectionMatch& match : matches) {
    frame.landmarks[static_cast<std::size_t>(match.keypoint)] = match.landmark;
  }
}

// Those that the frame does not have yet.
std::vector<LandmarkPrediction> without(const std::vector<LandmarkPrediction>& predictions,
                                        const Frame& frame) {
  std::vector<LandmarkId> matched = valid_ids(frame.landmarks);
  std::sort(matched.begin(), matched.end());
  std::vector<LandmarkPrediction> open;
  std::copy_if(predictions.begin(), predictions.end(), std::back_inserter(open),
               [&](const LandmarkPrediction& prediction) {
                 return !std::binary_search(matched.begin(), matched.end(), prediction.id);
               });
  return open;
}

// At the border of the image a landmark can be seen that was expected just outside.
void count_found_as_visible(SeenLandmarks& counts) {
  std::vector<LandmarkId> expected = counts.visible;
  std::sort(expected.begin(), expected.end());
  for (const LandmarkId id : counts.found) {
    if (!std::binary_search(expected.begin(), expected.end(), id)) counts.visible.push_back(id);
  }
}

}  // namespace

std::string TrackerOptions::validate() const {
  if (max_features < 1) {
    return "tracking: max_features must be positive";
  }
  if (!(local_map_radius > 0)) return "tracking: local_map_radius must be positive";
  if (min_local_map_inliers < 6) return "tracking: min_local_map_inliers must be at least 6";
  for (const std::string& error :
       {matcher.validate(), local_map.validate(), relocalization.validate(), keyframes.validate(),
        refinement.validate()}) {
    if (!error.empty()) {
      return error;
    }
  }
  return {};
}

std::vector<LandmarkId> valid_ids(const std::vector<LandmarkId>& ids) {
  std::vector<LandmarkId> valid;
  std::copy_if(ids.begin(), ids.end(), std::back_inserter(valid),
               [](LandmarkId id) { return id.valid(); });
  return valid;
}

FeatureView MapMatcher::view_of(const Frame& frame) const {
  return {camera_, frame.features.left, frame.features.u_right, frame.grid};
}

PoseSupport MapMatcher::refine(const MapSnapshot& map, const Search& search, Frame& frame,
                               std::span<const PoseObservation> others) const {
  return refine_with(options_.pose, map, search, frame, others);
}

MapMatcher::Search MapMatcher::search_of(const MapSnapshot& map, const Frame& frame,
                                         std::span<const LandmarkPrediction> predictions) const {
  const double area = static_cast<double>(image_width(camera_)) * image_height(camera_);
  std::vector<Keypoint> places;
  for (const LandmarkPrediction& prediction : predictions) {
    places.push_back({.x = static_cast<float>(prediction.pixel.x()),
                      .y = static_cast<float>(prediction.pixel.y()),
                      .scale = static_cast<float>(prediction.scale)});
  }
  return {count_independent(std::move(places)),
          static_cast<double>(frame.size()) / area *
              accidental_match_rate(map, view_of(frame), predictions, options_.matcher)};
}

bool MapMatcher::is_redundant(const MapSnapshot& map, const Frame& frame, double max_distance,
                              int new_points) const {
  std::vector<LandmarkInView> in_view;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const Landmark* landmark = frame.landmarks[i].valid() ? map.find(frame.landmarks[i]) : nullptr;
    if (landmark == nullptr ||
        (frame.cam_from_world * landmark->point_in_world).norm() > max_distance) {
      continue;
    }
    in_view.push_back({landmark, normalized_scale(camera_, frame.features.left.keypoints[i])});
  }
  return hybrid_slam::is_redundant(map, in_view, new_points, options_.redundancy);
}

void MapMatcher::keep_agreeing(const MapSnapshot& map, Frame& frame) const {
  PoseRefinementOptions test_alone = options_.pose;
  test_alone.rounds = 1;
  test_alone.iterations = 0;
  refine_with(test_alone, map, {}, frame, {});
}

PoseSupport MapMatcher::refine_with(const PoseRefinementOptions& options, const MapSnapshot& map,
                                    const Search& search, Frame& frame,
                                    std::span<const PoseObservation> others) const {
  std::vector<std::size_t> keypoint;
  auto observations = pose_observations(map, frame.features.left, frame.features.u_right,
                                        frame.landmarks, keypoint);
  observations.insert(observations.end(), others.begin(), others.end());
  auto refined = refine_pose(camera_, frame.cam_from_world, observations, options);
  PoseSupport support;
  support.candidates = search.landmarks;
  std::vector<LandmarkId> kept(frame.size());
  std::vector<double> depths;
  std::vector<Keypoint> agreeing;
  double chances = 0;
  for (std::size_t i = 0; i < keypoint.size(); ++i) {
    if (!refined.inlier[i]) continue;
    chances += chance_in_area(frame.features.left.keypoints[keypoint[i]].sigma, options.chi2_mono,
                              1 / search.accidents_per_area);
    agreeing.push_back(frame.features.left.keypoints[keypoint[i]]);
    kept[keypoint[i]] = frame.landmarks[keypoint[i]];
    depths.push_back((refined.cam_from_world * observations[i].point_in_world).norm());
  }
  support.inliers = static_cast<int>(depths.size());
  support.evidence = count_independent(std::move(agreeing));
  support.candidates = std::max(support.candidates, support.evidence);
  if (support.inliers > 0) support.chance = chances / support.inliers;
  support.covariance = covariance_of_information(refined.information);
  support.depth = median_of(std::move(depths));
  frame.landmarks = std::move(kept);
  frame.cam_from_world = refined.cam_from_world;
  return support;
}

MapMatcher::Search MapMatcher::match_projections(const MapSnapshot& map,
                                                 std::span<const LandmarkId> ids, double radius,
                                                 Frame& frame) const {
  ProjectionMatcherOptions matcher = options_.matcher;
  matcher.radius = radius;
  const auto predictions =
      predict_landmarks(map, camera_, frame.cam_from_world, ids, matcher.max_view_angle_deg);
  const auto matches = match_predictions(map, view_of(frame), predictions, nullptr, matcher);
  frame.landmarks.assign(frame.size(), LandmarkId());
  assign(matches, frame);
  return search_of(map, frame, predictions);
}

std::optional<MapMatcher::LocalMapMatch> MapMatcher::match_local_map(
    const MapSnapshot& map, const std::vector<LandmarkId>& seeds, Frame& frame) {
  const LocalMap local = make_local_map(map, seeds, options_.local_map);
  if (!local.reference.valid()) {
    return std::nullopt;
  }
  LocalMapMatch match;
  match.reference = local.reference;
  const auto predictions = predict_landmarks(map, camera_, frame.cam_from_world, local.landmarks,
                                             options_.matcher.max_view_angle_deg);
  for (const LandmarkPrediction& prediction : predictions) {
    match.counts.visible.push_back(prediction.id);
  }
  std::vector<char> taken(frame.size(), 0);
  std::transform(frame.landmarks.begin(), frame.landmarks.end(), taken.begin(),
                 [](LandmarkId id) { return static_cast<char>(id.valid()); });
  ProjectionMatcherOptions matcher = options_.matcher;
  matcher.radius = options_.local_map_radius;
  assign(match_predictions(map, view_of(frame), without(predictions, frame), &taken, matcher),
         frame);
  match.search = search_of(map, frame, predictions);
  match.support = refine(map, match.search, frame);
  const std::vector<Keypoint> keypoints = frame.features.left.keypoints;
  const std::vector<float> u_right = frame.features.u_right;
  if (refiner_.refine(map, frame) > 0) match.support = refine(map, match.search, frame);
  match.counts.found = valid_ids(frame.landmarks);
  count_found_as_visible(match.counts);
  if (!is_believed(match.support)) {
    frame.features.left.keypoints = keypoints;
    frame.features.u_right = u_right;
    frame.aligned.clear();
    return std::nullopt;
  }
  return match;
}

bool MapMatcher::relocalize(const MapSnapshot& map, std::span<const KeyframeId> keyframes,
                            Frame& frame) const {
  const RelocalizationOptions& options = options_.relocalization;
  const auto match_all = [&](KeyframeId id) {
    return match_keyframe(map, id, frame.features.left, options.ratio,
                          options.max_descriptor_distance);
  };
  if (relocalize_in(map, keyframes, frame)) {
    return true;
  }
  if (places_ != nullptr && places_->knows(frame.features.left.kind)) {
    return find_place(map, keyframes, frame);
  }
  return relocalize(map, newest_keyframes(map, options.max_keyframes), match_all, frame);
}

bool MapMatcher::relocalize_in(const MapSnapshot& map, std::span<const KeyframeId> keyframes,
                               Frame& frame) const {
  const RelocalizationOptions& options = options_.relocalization;
  const auto match_all = [&](KeyframeId id) {
    return match_keyframe(map, id, frame.features.left, options.ratio,
                          options.max_descriptor_distance);
  };
  return relocalize(map, keyframes, match_all, frame);
}

bool MapMatcher::find_place(const MapSnapshot& map, std::span<const KeyframeId> tried,
                            Frame& frame) const {
  const RelocalizationOptions& options = options_.relocalization;
  const ImageWords words = places_->words_of(frame.features.left);
  std::vector<KeyframeId> keyframes;
  for (const SimilarKeyframe& similar :
       places_->similar(words.bow, static_cast<std::size_t>(options.max_keyframes), tried)) {
    keyframes.push_back(similar.keyframe);
  }
  const auto match_guided = [&](KeyframeId id) {
    return match_keyframe_guided(map, id, places_->index_of(map.at(id)), frame.features.left,
                                 words.index, options.ratio, options.max_descriptor_distance);
  };
  return relocalize(map, keyframes, match_guided, frame);
}

bool MapMatcher::relocalize(const MapSnapshot& map, std::span<const KeyframeId> keyframes,
                            const KeyframeMatcher& match, Frame& frame) const {
  auto found = hybrid_slam::relocalize(map, view_of(frame), keyframes, match, options_.matcher,
                                       options_.pose, options_.relocalization);
  if (!found) {
    return false;
  }
  frame.cam_from_world = found->cam_from_world;
  frame.landmarks = std::move(found->landmarks);
  return true;
}

}  // namespace hybrid_slam
