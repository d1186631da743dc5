#include "frontend/place_recognition/loop_verifier.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "frontend/matching/projection_matcher.h"
#include "frontend/place_recognition/guided_matching.h"
#include "frontend/place_recognition/loop_side.h"
#include "frontend/pose/direction_residual.h"

namespace hybrid_slam {
namespace {

// A landmark of the newer side at a keypoint of its keyframe, and one of the older side.
struct Match {
  int keypoint = 0;
  LandmarkId newer;  // invalid where the keypoint has none
  LandmarkId older;
};

class Verification {
 public:
  Verification(const MapSnapshot& map, KeyframeId keyframe, KeyframeId match,
               const KeyframeDatabase& places, const LoopVerifierOptions& options)
      : map_(map),
        places_(places),
        options_(options),
        newer_(map, keyframe, options.neighbours, options.min_shared_landmarks),
        older_(map, match, options.neighbours, options.min_shared_landmarks) {
    options_.pose.with_scale = !newer_.metric || !older_.metric;
  }

  LoopVerification run() {
    result_.reason = find_motion();
    if (result_.reason == LoopRejection::kNone) result_.reason = search();
    if (result_.reason == LoopRejection::kNone && !is_confirmed()) {
      result_.reason = LoopRejection::kUnconfirmed;
    }
    if (result_.reason == LoopRejection::kNone) result_.loop = measurement();
    return std::move(result_);
  }

 private:
  // Descriptor matches, RANSAC.
  LoopRejection find_motion() {
    const std::vector<Match> matches = match_descriptors();
    result_.matches = static_cast<int>(matches.size());
    if (result_.matches < options_.min_matches) return LoopRejection::kFewMatches;
    const auto found = solve_relative_pose_ransac(pairs_of(matches), options_.pose);
    if (!found) return LoopRejection::kNoGeometry;
    result_.inliers = found->inliers;
    newer_from_older_ = found->a_from_b;
    return LoopRejection::kNone;
  }

  // The landmarks of each side in the other's keyframe, and the motion from all of them.
  LoopRejection search() {
    std::vector<Match> matches = search_both_ways();
    std::vector<Match> two_way;
    std::copy_if(matches.begin(), matches.end(), std::back_inserter(two_way), [&](const Match& m) {
      return m.newer.valid() && keypoint_of(older_.keyframe.id, m.older) >= 0;
    });
    const auto refined = refine_relative_pose(pairs_of(two_way), newer_from_older_, options_.pose);
    if (!refined) return LoopRejection::kFewAfterSearch;
    newer_from_older_ = refined->a_from_b;
    std::size_t in_view = 0;
    matches_ = search_older_in(newer_, newer_cam_from_older_world(), &in_view);
    result_.final_matches = static_cast<int>(matches_.size());
    result_.found_share =
        in_view > 0 ? static_cast<double>(matches_.size()) / static_cast<double>(in_view) : 0;
    if (result_.final_matches < options_.min_final_matches) return LoopRejection::kFewAfterSearch;
    if (result_.found_share < options_.min_found_share) return LoopRejection::kUnlike;
    return LoopRejection::kNone;
  }

  // One neighbour of the keyframe, at least, sees the older side where the loop puts it.
  bool is_confirmed() {
    const Rigid3d world_from_newer = inverse(newer_.keyframe.cam_from_world);
    for (const KeyframeId id : newer_.neighbours) {
      const KeyframeView neighbour(map_, id);
      const Sim3d neighbour_from_newer(neighbour.keyframe.cam_from_world * world_from_newer);
      const Rigid3d pose = without_scale(neighbour_from_newer * newer_from_older_ *
                                         Sim3d(older_.keyframe.cam_from_world));
      const auto found = static_cast<int>(search_older_in(neighbour, pose, nullptr).size());
      result_.confirmations = std::max(result_.confirmations, found);
      if (found >= options_.min_confirmations) return true;
    }
    return false;
  }

  LoopMeasurement measurement() const {
    LoopMeasurement loop;
    loop.keyframe = newer_.keyframe.id;
    loop.match = older_.keyframe.id;
    loop.keyframe_from_match = newer_from_older_;
    loop.with_scale = options_.pose.with_scale;
    loop.observations = newer_.keyframe.observations;
    std::set<LandmarkId> named;
    for (const Match& match : matches_) {
      if (match.newer == match.older || named.contains(match.older)) continue;
      if (match.newer.valid()) {
        if (named.contains(match.newer)) continue;
        named.insert(match.newer);
        loop.same.push_back({match.older, match.newer});
      } else {
        loop.new_observations.push_back(
            {match.older, {loop.keyframe, static_cast<std::uint32_t>(match.keypoint)}});
      }
      named.insert(match.older);
    }
    return loop;
  }

  std::vector<Match> match_descriptors() const {
    BruteForceOptions matching;
    matching.ratio = options_.ratio;
    matching.max_descriptor_distance = options_.max_descriptor_distance;
    std::vector<Match> matches;
    for (const DescriptorMatch& match :
         match_guided(newer_.observations.features, places_.index_of(newer_.keyframe),
                      older_.observations.features, places_.index_of(older_.keyframe), matching)) {
      const LandmarkId newer = newer_.keyframe.landmarks[static_cast<std::size_t>(match.query)];
      const LandmarkId older = older_.keyframe.landmarks[static_cast<std::size_t>(match.train)];
      if (newer != older) matches.push_back({match.query, newer, older});
    }
    return matches;
  }

  // Where a keyframe sees a landmark; -1 if it does not.
  int keypoint_of(KeyframeId keyframe, LandmarkId landmark) const {
    const auto& seen = map_.at(landmark).observations;
    const auto at = std::lower_bound(seen.begin(), seen.end(), Observation{keyframe, 0});
    return at != seen.end() && at->keyframe == keyframe ? static_cast<int>(at->keypoint) : -1;
  }

  PoseObservation seen_by(const KeyframeView& view, LandmarkId landmark, int index) const {
    const Keypoint& keypoint =
        view.observations.features.keypoints[static_cast<std::size_t>(index)];
    return {view.keyframe.cam_from_world * map_.at(landmark).point_in_world,
            {keypoint.x, keypoint.y, kNoRightMatch},
            std::hypot(static_cast<double>(keypoint.sigma), options_.surroundings_sigma)};
  }

  std::vector<PointPair> pairs_of(const std::vector<Match>& matches) const {
    std::vector<PoseObservation> in_newer;
    std::vector<PoseObservation> in_older;
    for (const Match& match : matches) {
      in_newer.push_back(seen_by(newer_, match.newer, match.keypoint));
      in_older.push_back(
          seen_by(older_, match.older, keypoint_of(older_.keyframe.id, match.older)));
    }
    const auto a = bearing_observations(newer_.camera, in_newer);
    const auto b = bearing_observations(older_.camera, in_older);
    std::vector<PointPair> pairs;
    for (std::size_t i = 0; i < matches.size(); ++i) pairs.push_back({a[i], b[i]});
    return pairs;
  }

  Rigid3d newer_cam_from_older_world() const {
    return without_scale(newer_from_older_ * Sim3d(older_.keyframe.cam_from_world));
  }

  // Landmarks `ids` in a keyframe at a pose in their world: what lies within the noise of where it
  // is expected. `in_view` (may be null) receives how many are.
  std::vector<ProjectionMatch> search_in(const KeyframeView& view, const Rigid3d& cam_from_world,
                                         const std::vector<LandmarkId>& ids,
                                         std::size_t* in_view) const {
    ProjectionMatcherOptions matcher;
    matcher.radius = options_.search_radius;
    matcher.max_descriptor_distance = options_.max_descriptor_distance;
    matcher.max_scale_ratio = options_.max_scale_ratio;
    // Its disparities are no guide where the scale is open.
    static const std::vector<float> kNoRight;
    const FeatureView features{view.camera, view.observations.features,
                               options_.pose.with_scale ? kNoRight : view.observations.u_right,
                               view.grid};
    const auto predictions =
        predict_landmarks(map_, view.camera, cam_from_world, ids, matcher.max_view_angle_deg);
    if (in_view != nullptr) *in_view = predictions.size();
    return match_predictions(map_, features, predictions, nullptr, matcher);
  }

  std::vector<Match> search_older_in(const KeyframeView& view, const Rigid3d& cam_from_older_world,
                                     std::size_t* in_view) const {
    const auto found = search_in(view, cam_from_older_world, older_.landmarks, in_view);
    std::vector<PoseObservation> seen;
    for (const ProjectionMatch& match : found) {
      seen.push_back(seen_by(view, match.landmark, match.keypoint));
      seen.back().point_in_world = cam_from_older_world * map_.at(match.landmark).point_in_world;
    }
    const auto bearings = bearing_observations(view.camera, seen);
    std::vector<Match> matches;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!bearings[i].is_usable() ||
          direction_chi2(bearings[i], bearings[i].point_in_world) > options_.pose.chi2) {
        continue;
      }
      const auto keypoint = static_cast<std::size_t>(found[i].keypoint);
      matches.push_back({found[i].keypoint, view.keyframe.landmarks[keypoint], found[i].landmark});
    }
    return matches;
  }

  // What the newer keyframe sees of the older side, without what the older keyframe contradicts.
  std::vector<Match> search_both_ways() const {
    std::size_t in_view = 0;
    std::vector<Match> matches;
    for (const ProjectionMatch& match :
         search_in(newer_, newer_cam_from_older_world(), older_.landmarks, &in_view)) {
      const auto keypoint = static_cast<std::size_t>(match.keypoint);
      matches.push_back({match.keypoint, newer_.keyframe.landmarks[keypoint], match.landmark});
    }
    const Rigid3d older_cam_from_newer_world =
        without_scale(inverse(newer_from_older_) * Sim3d(newer_.keyframe.cam_from_world));
    std::map<LandmarkId, LandmarkId> older_of;
    for (const ProjectionMatch& match :
         search_in(older_, older_cam_from_newer_world, newer_.landmarks, &in_view)) {
      older_of[match.landmark] =
          older_.keyframe.landmarks[static_cast<std::size_t>(match.keypoint)];
    }
    std::erase_if(matches, [&](const Match& match) {
      const auto other = older_of.find(match.newer);
      return match.newer == match.older ||
             (other != older_of.end() && other->second.valid() && other->second != match.older);
    });
    return matches;
  }

  const MapSnapshot& map_;
  const KeyframeDatabase& places_;
  LoopVerifierOptions options_;
  LoopSide newer_;
  LoopSide older_;
  Sim3d newer_from_older_;
  std::vector<Match> matches_;
  LoopVerification result_;
};

}  // namespace

const char* to_string(LoopRejection reason) {
  switch (reason) {
    case LoopRejection::kNone:
      return "none";
    case LoopRejection::kFewMatches:
      return "few matches";
    case LoopRejection::kNoGeometry:
      return "no geometry";
    case LoopRejection::kFewAfterSearch:
      return "few after search";
    case LoopRejection::kUnlike:
      return "unlike";
    case LoopRejection::kUnconfirmed:
      return "unconfirmed";
  }
  return "";
}

std::string LoopVerifierOptions::validate() const {
  if (!(ratio > 0 && ratio <= 1)) return "loops: ratio must lie in (0, 1]";
  if (!(max_descriptor_distance > 0) || !(search_radius > 0) || !(max_scale_ratio >= 1)) {
    return "loops: distance and radius must be positive, max_scale_ratio at least 1";
  }
  if (min_matches < 3 || min_final_matches < 3 || min_confirmations < 1 || neighbours < 1 ||
      min_shared_landmarks < 1) {
    return "loops: counts must be positive, those of matches at least 3";
  }
  if (!(surroundings_sigma >= 0) || !(min_found_share >= 0 && min_found_share <= 1)) {
    return "loops: surroundings_sigma must not be negative, min_found_share lie in [0, 1]";
  }
  return pose.validate();
}

LoopVerifier::LoopVerifier(const LoopVerifierOptions& options) : options_(options) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument(error);
}

LoopVerification LoopVerifier::verify(const MapSnapshot& map, KeyframeId keyframe, KeyframeId match,
                                      const KeyframeDatabase& places) const {
  if (map.find(keyframe) == nullptr || map.find(match) == nullptr || keyframe == match) return {};
  if (!places.contains(keyframe) || !places.contains(match)) return {};
  return Verification(map, keyframe, match, places, options_).run();
}

}  // namespace hybrid_slam
