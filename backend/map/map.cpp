#include "backend/map/map.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "backend/map/dropped_features.h"
#include "backend/map/landmark_attributes.h"
#include "backend/map/map_transaction.h"
#include "backend/map/marked_landmarks.h"
#include "backend/map/odometry.h"
#include "backend/map/prefetch.h"
#include "backend/map/spanning_tree.h"

namespace hybrid_slam {

namespace {

void require(bool condition, const char* what) {
  if (!condition) throw std::logic_error(what);
}

void validate(const MapTables& tables, const NewKeyframe& made) {
  require(made.observations != nullptr, "Map::add_keyframe: no observations");
  const FrameObservations& frame = *made.observations;
  require(frame.camera.value < tables.cameras.size(), "Map::add_keyframe: unknown camera");
  require(frame.features.descriptors.size() == frame.size(),
          "Map::add_keyframe: keypoints and descriptors differ in number");
  require(frame.u_right.empty() || frame.u_right.size() == frame.size(),
          "Map::add_keyframe: keypoints and right matches differ in number");
  require(made.landmarks.empty() || made.landmarks.size() == frame.size(),
          "Map::add_keyframe: keypoints and landmarks differ in number");
  require(made.cam_from_world.params.allFinite(), "Map::add_keyframe: pose is not finite");
  if (const Keyframe* origin = tables.keyframes.find(tables.origin.value)) {
    require(origin->observations->features.kind == frame.features.kind,
            "Map::add_keyframe: descriptors of another kind than the map's");
  }
  for (const auto& [keypoint, point] : made.new_points) {
    require(keypoint < frame.size() && point.allFinite(), "Map::add_keyframe: bad new point");
  }
  require(made.odometry == nullptr || is_valid(*made.odometry, frame.size()),
          "Map::add_keyframe: odometry without a covariance, or by keypoints that are not there");
}

// Nothing that has gone is a fault; what can never have been right is.
void validate(const MapTables& tables, const MapEdit& edit) {
  const auto check = [&](const Observation& observation, bool may_be_dropped = false) {
    const Keyframe* keyframe = tables.keyframes.find(observation.keyframe.value);
    const std::size_t dropped =
        keyframe != nullptr && may_be_dropped ? keyframe->observations->dropped : 0;
    require(keyframe == nullptr || observation.keypoint < keyframe->landmarks.size() + dropped,
            "Map::apply: no such keypoint");
  };
  for (const auto& added : edit.new_observations) check(added.observation);
  for (const auto& erased : edit.erased_observations) check(erased.observation, true);
  for (const auto& landmark : edit.new_landmarks) {
    require(landmark.point_in_world.allFinite(), "Map::apply: point is not finite");
    for (const Observation& observation : landmark.observations) check(observation);
  }
}

void count(PersistentTable<Landmark>& landmarks, const std::vector<LandmarkCount>& counted) {
  for (const LandmarkCount& one : counted) {
    if (landmarks.find(one.landmark.value) == nullptr) continue;
    Landmark& landmark = landmarks.edit(one.landmark.value);
    landmark.visible += one.visible;
    landmark.found += one.found;
  }
}

// Brings what is read of those after the one at `at` into the cache.
void fetch(const PersistentTable<Landmark>& landmarks, const std::vector<LandmarkId>& ids,
           std::size_t at) {
  const auto find = [&](std::size_t i) {
    return i < ids.size() ? landmarks.find(ids[i].value) : nullptr;
  };
  prefetch(find(at + 2 * kPrefetchAhead));
  if (const Landmark* next = find(at + kPrefetchAhead)) prefetch_all(next->observations);
}

}  // namespace

Map::Map() : view_(MapTables{}) {}

CameraId Map::add_camera(const Camera& camera) {
  auto& cameras = view_.tables_.cameras;
  cameras.push_back(camera);
  view_.tables_.newest_frame_index.push_back(-1);
  return CameraId(static_cast<std::uint32_t>(cameras.size() - 1));
}

KeyframeId Map::add_keyframe(const NewKeyframe& made) {
  MapTables& tables = view_.tables_;
  validate(tables, made);
  const KeyframeId id(tables.next_keyframe++);
  Keyframe& keyframe = tables.keyframes.insert(id.value, {});
  keyframe.id = id;
  keyframe.observations = made.observations;
  keyframe.cam_from_world = made.cam_from_world;
  keyframe.landmarks.resize(made.observations->size());
  std::int64_t& newest = tables.newest_frame_index[made.observations->camera.value];
  newest = std::max(newest, made.observations->frame_index);
  if (!tables.origin.valid()) {
    tables.origin = id;
    keyframe.keep = true;
  }

  MapTransaction transaction(tables);
  for (std::uint32_t keypoint = 0; keypoint < made.landmarks.size(); ++keypoint) {
    transaction.add_observation(made.landmarks[keypoint], {id, keypoint});
  }
  for (const auto& [keypoint, point] : made.new_points) {
    transaction.create_landmark({point, {{id, keypoint}}});
  }
  transaction.commit();
  if (id != tables.origin) attach_to_tree(tables, id, made.reference);
  attach_odometry(tables, id, made.odometry);
  Keyframe& added = tables.keyframes.edit(id.value);
  const bool begins = id == tables.origin || (added.odometry != nullptr &&
                                              is_loose(*added.odometry) && added.covisible.empty());
  added.component = begins ? id : tables.keyframes.find(added.parent.value)->component;
  added.keep = added.keep || begins;
  return id;
}

void Map::join_components(KeyframeId a, KeyframeId b) {
  MapTables& tables = view_.tables_;
  const Keyframe* const one = tables.keyframes.find(a.value);
  const Keyframe* const other = tables.keyframes.find(b.value);
  if (one == nullptr || other == nullptr || one->component == other->component) return;
  const KeyframeId stays = std::min(one->component, other->component);
  const KeyframeId goes = std::max(one->component, other->component);
  for (const KeyframeId id : view_.keyframe_ids()) {
    if (view_.at(id).component == goes) tables.keyframes.edit(id.value).component = stays;
  }
}

void Map::apply(const MapEdit& edit) {
  MapTables& tables = view_.tables_;
  validate(tables, edit);
  MapTransaction transaction(tables);
  for (const auto& merge : edit.merged) transaction.merge(merge);
  for (const auto& added : edit.new_observations) {
    transaction.add_observation(added.landmark, added.observation);
  }
  for (const auto& landmark : edit.new_landmarks) transaction.create_landmark(landmark);
  for (const auto& erased : edit.erased_observations) {
    transaction.remove_observation(erased.landmark, erased.observation);
  }
  for (const LandmarkId id : edit.erased_landmarks) transaction.erase_landmark(id);
  for (const KeyframeId id : edit.erased_keyframes) transaction.erase_keyframe(id);
  transaction.commit();
  count(tables.landmarks, edit.counted);
}

void Map::move(const std::vector<std::pair<KeyframeId, Rigid3d>>& cam_from_world,
               const std::vector<std::pair<LandmarkId, Eigen::Vector3d>>& point_in_world) {
  MapTables& tables = view_.tables_;
  for (const auto& [id, pose] : cam_from_world) {
    require(pose.params.allFinite(), "Map::move: pose is not finite");
  }
  for (const auto& [id, point] : point_in_world) {
    require(point.allFinite(), "Map::move: point is not finite");
  }
  MarkedLandmarks changed(tables.next_landmark);
  for (const auto& [id, pose] : cam_from_world) {
    Keyframe* const keyframe = tables.keyframes.edit_if(id.value);
    if (keyframe == nullptr) continue;
    keyframe->cam_from_world = pose;
    for (const LandmarkId seen : keyframe->landmarks) changed.mark(seen);
  }
  // Each landmark is looked up once: there are thousands, none of which is in a cache.
  std::vector<std::pair<LandmarkId, const Eigen::Vector3d*>> places;
  places.reserve(point_in_world.size());
  for (const auto& [id, point] : point_in_world) {
    places.emplace_back(id, &point);
    changed.mark(id);
  }
  std::stable_sort(places.begin(), places.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<LandmarkId> ids;
  changed.for_each([&](LandmarkId id) { ids.push_back(id); });
  CameraCenters centers(tables);
  auto place = places.begin();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    fetch(tables.landmarks, ids, i);
    Landmark* const landmark = tables.landmarks.edit_if(ids[i].value);
    for (; place != places.end() && place->first == ids[i]; ++place) {
      if (landmark != nullptr) landmark->point_in_world = *place->second;
    }
    if (landmark != nullptr) update_geometry(tables, centers, *landmark);
  }
}

void Map::set_camera(CameraId id, const Camera& camera) {
  MapTables& tables = view_.tables_;
  tables.cameras.at(id.value) = camera;
  for (const LandmarkId landmark : view_.landmark_ids()) {
    update_geometry(tables, tables.landmarks.edit(landmark.value));
  }
}

void Map::set_correction(CameraId id, const RigCorrection& correction) {
  MapTables& tables = view_.tables_;
  require(baseline(tables.cameras.at(id.value)) > 0, "Map::set_correction: no stereo camera");
  if (correction.empty()) {
    tables.corrections.erase(id);
  } else {
    tables.corrections[id] = correction;
  }
}

void Map::set_keep(KeyframeId id) {
  auto& keyframes = view_.tables_.keyframes;
  if (keyframes.find(id.value) != nullptr) keyframes.edit(id.value).keep = true;
}

void Map::set_covariances(std::shared_ptr<const KeyframeCovariances> covariances) {
  view_.tables_.covariances = std::move(covariances);
}

std::vector<std::uint32_t> Map::drop_features(KeyframeId id) {
  MapTables& tables = view_.tables_;
  const Keyframe* keyframe = tables.keyframes.find(id.value);
  if (keyframe == nullptr) return {};
  std::vector<std::uint32_t> kept;
  for (std::uint32_t keypoint = 0; keypoint < keyframe->landmarks.size(); ++keypoint) {
    const bool stays =
        keyframe->landmarks[keypoint].valid() || keyframe->observations->has_right(keypoint);
    if (stays) kept.push_back(keypoint);
  }
  if (kept.size() < keyframe->landmarks.size()) keep_features(tables, id, kept);
  return kept;
}

std::shared_ptr<const MapSnapshot> Map::snapshot() {
  return std::shared_ptr<const MapSnapshot>(new MapSnapshot(view_.tables_.share()));
}

}  // namespace hybrid_slam
