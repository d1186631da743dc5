#pragma once

#include <vector>

#include "backend/map/covisibility.h"
#include "backend/map/map_edit.h"
#include "backend/map/map_tables.h"

namespace hybrid_slam {

// The primitive changes of which the map's verbs consist. Between the first and commit() the links
// between keyframes and landmarks are right at all times; covisibility and the landmarks' derived
// attributes follow at commit(). What no longer exists or does not fit is skipped.
class MapTransaction {
 public:
  explicit MapTransaction(MapTables& tables) : tables_(tables) {}

  // Skipped if the keypoint has a landmark already or the keyframe sees this landmark elsewhere.
  void add_observation(LandmarkId id, const Observation& observation);

  // The landmark goes too if it is left without support. Skipped if the keyframe sees it elsewhere;
  // a keypoint whose index was a higher one before features were dropped is not elsewhere.
  void remove_observation(LandmarkId id, const Observation& observation);

  // Not born if the observations that can be had do not support it.
  void create_landmark(const NewLandmark& landmark);

  void merge(const LandmarkMerge& merge);
  void erase_landmark(LandmarkId id);
  void erase_keyframe(KeyframeId id);  // not the origin, nor one that is marked `keep`
  void commit();

 private:
  bool can_observe(LandmarkId id, const Observation& observation) const;
  void link(Landmark& landmark, const Observation& observation);
  void unlink(Landmark& landmark, const Observation& observation);

  MapTables& tables_;
  CovisibilityChanges covisibility_;
  std::vector<LandmarkId> changed_;
};

}  // namespace hybrid_slam
