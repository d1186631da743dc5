#include "backend/map/map_transaction.h"

#include <algorithm>

#include "backend/map/landmark_attributes.h"
#include "backend/map/odometry.h"
#include "backend/map/spanning_tree.h"

namespace hybrid_slam {

namespace {

// The first observation that is not before the keyframe's.
auto place_of(std::vector<Observation>& observations, KeyframeId keyframe) {
  return std::lower_bound(observations.begin(), observations.end(), keyframe,
                          [](const Observation& o, KeyframeId key) { return o.keyframe < key; });
}

bool is_seen_by(const Landmark& landmark, KeyframeId keyframe) {
  return std::any_of(landmark.observations.begin(), landmark.observations.end(),
                     [&](const Observation& o) { return o.keyframe == keyframe; });
}

}  // namespace

bool MapTransaction::can_observe(LandmarkId id, const Observation& observation) const {
  const Keyframe* keyframe = tables_.keyframes.find(observation.keyframe.value);
  const Landmark* landmark = tables_.landmarks.find(id.value);
  return keyframe != nullptr && landmark != nullptr &&
         !keyframe->landmarks[observation.keypoint].valid() &&
         !is_seen_by(*landmark, observation.keyframe);
}

void MapTransaction::link(Landmark& landmark, const Observation& observation) {
  covisibility_.add(observation.keyframe, landmark.observations, +1);
  landmark.observations.insert(place_of(landmark.observations, observation.keyframe), observation);
  tables_.keyframes.edit(observation.keyframe.value).landmarks[observation.keypoint] = landmark.id;
  changed_.push_back(landmark.id);
}

void MapTransaction::unlink(Landmark& landmark, const Observation& observation) {
  landmark.observations.erase(place_of(landmark.observations, observation.keyframe));
  covisibility_.add(observation.keyframe, landmark.observations, -1);
  tables_.keyframes.edit(observation.keyframe.value).landmarks[observation.keypoint] = LandmarkId();
  if (landmark.reference == observation.keyframe && !landmark.observations.empty()) {
    landmark.reference = landmark.observations.front().keyframe;
  }
  changed_.push_back(landmark.id);
}

void MapTransaction::add_observation(LandmarkId id, const Observation& observation) {
  if (can_observe(id, observation)) link(tables_.landmarks.edit(id.value), observation);
}

void MapTransaction::remove_observation(LandmarkId id, const Observation& observation) {
  const Keyframe* keyframe = tables_.keyframes.find(observation.keyframe.value);
  if (keyframe == nullptr || tables_.landmarks.find(id.value) == nullptr) return;
  const std::vector<Observation>& all = tables_.landmarks.find(id.value)->observations;
  const auto found = std::find_if(all.begin(), all.end(), [&](const Observation& one) {
    return one.keyframe == observation.keyframe;
  });
  if (found == all.end()) return;
  const bool may_have_moved = keyframe->observations->dropped > 0;
  if (found->keypoint > observation.keypoint ||
      (found->keypoint < observation.keypoint && !may_have_moved)) {
    return;
  }
  const Observation seen = *found;
  Landmark& landmark = tables_.landmarks.edit(id.value);
  unlink(landmark, seen);
  if (!is_supported(tables_, landmark)) erase_landmark(id);
}

void MapTransaction::create_landmark(const NewLandmark& made) {
  const LandmarkId id(tables_.next_landmark++);
  Landmark& landmark = tables_.landmarks.insert(id.value, {});
  landmark.id = id;
  landmark.point_in_world = made.point_in_world;
  landmark.visible = 1;
  landmark.found = 1;
  for (const Observation& observation : made.observations) add_observation(id, observation);
  if (!is_supported(tables_, landmark)) {
    erase_landmark(id);
  } else {
    landmark.reference = landmark.observations.front().keyframe;
  }
}

void MapTransaction::merge(const LandmarkMerge& merge) {
  const Landmark* dropped = tables_.landmarks.find(merge.drop.value);
  if (dropped == nullptr || tables_.landmarks.find(merge.keep.value) == nullptr) return;
  if (merge.keep == merge.drop) return;
  const std::vector<Observation> moved = dropped->observations;
  const int visible = dropped->visible;
  const int found = dropped->found;
  erase_landmark(merge.drop);
  for (const Observation& observation : moved) add_observation(merge.keep, observation);
  Landmark& kept = tables_.landmarks.edit(merge.keep.value);
  kept.visible += visible;
  kept.found += found;
}

void MapTransaction::erase_landmark(LandmarkId id) {
  if (tables_.landmarks.find(id.value) == nullptr) return;
  Landmark& landmark = tables_.landmarks.edit(id.value);
  while (!landmark.observations.empty()) {
    const Observation last = landmark.observations.back();
    unlink(landmark, last);
  }
  tables_.landmarks.erase(id.value);
}

void MapTransaction::erase_keyframe(KeyframeId id) {
  const Keyframe* keyframe = tables_.keyframes.find(id.value);
  if (keyframe == nullptr || keyframe->keep || id == tables_.origin) return;
  const std::vector<LandmarkId> landmarks = keyframe->landmarks;
  for (std::uint32_t keypoint = 0; keypoint < landmarks.size(); ++keypoint) {
    remove_observation(landmarks[keypoint], {id, keypoint});
  }
  covisibility_.write(tables_.keyframes);
  detach_from_tree(tables_, id);
  detach_odometry(tables_, id);
  tables_.keyframes.erase(id.value);
}

void MapTransaction::commit() {
  covisibility_.write(tables_.keyframes);
  std::sort(changed_.begin(), changed_.end());
  changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
  for (const LandmarkId id : changed_) {
    if (tables_.landmarks.find(id.value) == nullptr) continue;
    Landmark& landmark = tables_.landmarks.edit(id.value);
    update_appearance(tables_, landmark);
    update_geometry(tables_, landmark);
  }
  changed_.clear();
}

}  // namespace hybrid_slam
