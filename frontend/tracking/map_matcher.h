#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "backend/map/map_edit.h"
#include "backend/map/map_snapshot.h"
#include "frontend/mapping/redundancy.h"
#include "frontend/matching/projection_matcher.h"
#include "frontend/place_recognition/keyframe_database.h"
#include "frontend/pose/pose_belief.h"
#include "frontend/pose/pose_refinement.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/keyframe_policy.h"
#include "frontend/tracking/local_map.h"
#include "frontend/tracking/relocalization.h"
#include "frontend/tracking/track_refinement.h"

namespace hybrid_slam {

// What the trackers of both cameras have in common.
struct TrackerOptions {
  int max_features = 2000;         // N: the measure of shares
  double local_map_radius = 3;     // [px]
  int min_local_map_inliers = 30;  // no effect: see is_believed()
  ProjectionMatcherOptions matcher;
  PoseRefinementOptions pose;
  LocalMapOptions local_map;
  KeyframePolicyOptions keyframes;
  RedundancyOptions redundancy;  // as culling has it
  RelocalizationOptions relocalization;
  TrackRefinementOptions refinement;

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

std::vector<LandmarkId> valid_ids(const std::vector<LandmarkId>& ids);

// The steps by which a frame of either camera is fitted to the map. Each starts from the frame's
// pose and landmarks and leaves better ones there.
class MapMatcher {
 public:
  // `places` may be null; who owns it lets it follow the map. `shading`: see TrackRefiner.
  MapMatcher(CameraId camera_id, const Camera& camera, const TrackerOptions& options,
             std::shared_ptr<const KeyframeDatabase> places,
             const std::optional<FoundParameter>& shading = std::nullopt)
      : camera_(camera),
        options_(options),
        refiner_(camera_id, camera, options.refinement, shading),
        places_(std::move(places)) {}

  FeatureView view_of(const Frame& frame) const;

  // Landmarks that were looked for, independent ones (independent_patches.h), and the mean chance
  // that a keypoint has to match one by accident: keypoints per area times accidental_match_rate()
  // [1 / px^2].
  struct Search {
    int landmarks = 0;
    double accidents_per_area = 0;
  };

  // Optimises the pose on the landmarks that the frame has, found in a search, and on `others`,
  // which the map does not hold. Drops those that disagree. Returns what speaks for the pose: of
  // the landmarks looked for, so many agree with it, each with the chance that an unlike image has
  // a keypoint there that matches.
  PoseSupport refine(const MapSnapshot& map, const Search& search, Frame& frame,
                     std::span<const PoseObservation> others = {}) const;

  // Drops the landmarks that disagree with the frame's pose, which stays as it is.
  void keep_agreeing(const MapSnapshot& map, Frame& frame) const;

  // Looks for landmarks in windows of `radius` [px] around their projections, instead of those that
  // the frame has. Nothing is optimised.
  Search match_projections(const MapSnapshot& map, std::span<const LandmarkId> ids, double radius,
                           Frame& frame) const;

  struct LocalMapMatch {
    KeyframeId reference;  // shares most landmarks with the frame, of either camera
    Search search;
    PoseSupport support;  // given the landmarks
    SeenLandmarks counts;
  };

  // Adds the landmarks of keyframes around `seeds`, at the local map's radius, aligns patches and
  // optimises. None where the pose is not believed, or where nothing is around: then the frame's
  // keypoints are as before, its pose and its landmarks are those that were not believed.
  std::optional<LocalMapMatch> match_local_map(const MapSnapshot& map,
                                               const std::vector<LandmarkId>& seeds, Frame& frame);

  // Finds the frame without a prediction, in the first of `keyframes` that shows it, or else
  // anywhere in the map: in the keyframes that look most like it, or in the newest ones where there
  // are no places, or none for descriptors of this kind.
  bool relocalize(const MapSnapshot& map, std::span<const KeyframeId> keyframes,
                  Frame& frame) const;

  // The same in `keyframes` alone.
  bool relocalize_in(const MapSnapshot& map, std::span<const KeyframeId> keyframes,
                     Frame& frame) const;

  // Whether the frame would be redundant as a keyframe that adds so many points to its landmarks,
  // of those nearer than this.
  bool is_redundant(const MapSnapshot& map, const Frame& frame, double max_distance,
                    int new_points) const;

  // The frame becomes a keyframe: its image can serve as a reference.
  void remember_keyframe(const MapSnapshot& map, const Frame& frame) {
    refiner_.forget_culled(map);
    refiner_.remember(frame);
  }

  // See TrackRefiner.
  void learn_shading(const MapSnapshot& map, const Frame& frame) {
    refiner_.learn_shading(map, frame);
  }

  // See TrackRefiner.
  void use_floor(std::shared_ptr<const NoiseFloor> floor) { refiner_.use_floor(std::move(floor)); }

  // See TrackRefiner.
  double shading() const { return refiner_.shading(); }
  const RunningEstimate& shading_estimate() const { return refiner_.shading_estimate(); }
  ShadingDoubt shading_doubt() const { return refiner_.shading_doubt(); }

 private:
  PoseSupport refine_with(const PoseRefinementOptions& options, const MapSnapshot& map,
                          const Search& search, Frame& frame,
                          std::span<const PoseObservation> others) const;
  Search search_of(const MapSnapshot& map, const Frame& frame,
                   std::span<const LandmarkPrediction> predictions) const;
  bool relocalize(const MapSnapshot& map, std::span<const KeyframeId> keyframes,
                  const KeyframeMatcher& match, Frame& frame) const;
  bool find_place(const MapSnapshot& map, std::span<const KeyframeId> tried, Frame& frame) const;

  Camera camera_;
  TrackerOptions options_;
  TrackRefiner refiner_;
  std::shared_ptr<const KeyframeDatabase> places_;
};

}  // namespace hybrid_slam
