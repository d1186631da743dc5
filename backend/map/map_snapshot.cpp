#include "backend/map/map_snapshot.h"

#include <algorithm>
#include <stdexcept>

namespace hybrid_slam {

const Keyframe* MapSnapshot::find(KeyframeId id) const { return tables_.keyframes.find(id.value); }

const Landmark* MapSnapshot::find(LandmarkId id) const { return tables_.landmarks.find(id.value); }

const Keyframe& MapSnapshot::at(KeyframeId id) const {
  const Keyframe* keyframe = find(id);
  if (keyframe == nullptr) throw std::out_of_range("MapSnapshot::at: no such keyframe");
  return *keyframe;
}

const Landmark& MapSnapshot::at(LandmarkId id) const {
  const Landmark* landmark = find(id);
  if (landmark == nullptr) throw std::out_of_range("MapSnapshot::at: no such landmark");
  return *landmark;
}

const Camera& MapSnapshot::camera(CameraId id) const { return tables_.cameras.at(id.value); }

RigCorrection MapSnapshot::correction(CameraId id) const {
  const auto known = tables_.corrections.find(id);
  return known == tables_.corrections.end() ? RigCorrection() : known->second;
}

const Camera& MapSnapshot::camera(const Keyframe& keyframe) const {
  return camera(keyframe.observations->camera);
}

std::size_t MapSnapshot::camera_count() const { return tables_.cameras.size(); }
std::size_t MapSnapshot::keyframe_count() const { return tables_.keyframes.size(); }
std::size_t MapSnapshot::landmark_count() const { return tables_.landmarks.size(); }
KeyframeId MapSnapshot::origin() const { return tables_.origin; }

std::vector<KeyframeId> MapSnapshot::keyframe_ids() const {
  std::vector<KeyframeId> ids;
  ids.reserve(keyframe_count());
  tables_.keyframes.for_each([&](std::uint64_t, const Keyframe& k) { ids.push_back(k.id); });
  return ids;
}

KeyframeId MapSnapshot::next_keyframe_id() const { return KeyframeId(tables_.next_keyframe); }
LandmarkId MapSnapshot::next_landmark_id() const { return LandmarkId(tables_.next_landmark); }

std::vector<KeyframeId> MapSnapshot::keyframe_ids_from(KeyframeId first) const {
  std::vector<KeyframeId> ids;
  for (std::uint32_t id = first.value; id < tables_.next_keyframe; ++id) {
    if (find(KeyframeId(id)) != nullptr) ids.emplace_back(id);
  }
  return ids;
}

std::vector<LandmarkId> MapSnapshot::landmark_ids() const {
  std::vector<LandmarkId> ids;
  ids.reserve(landmark_count());
  tables_.landmarks.for_each([&](std::uint64_t, const Landmark& l) { ids.push_back(l.id); });
  return ids;
}

std::vector<LandmarkId> MapSnapshot::changed_landmarks(const MapSnapshot& since) const {
  std::vector<LandmarkId> ids;
  tables_.landmarks.for_each_change(since.tables_.landmarks, [&](std::uint64_t index) {
    ids.emplace_back(static_cast<std::uint32_t>(index));
  });
  return ids;
}

std::vector<KeyframeId> MapSnapshot::changed_keyframes(const MapSnapshot& since) const {
  std::vector<KeyframeId> ids;
  tables_.keyframes.for_each_change(since.tables_.keyframes, [&](std::uint64_t index) {
    ids.emplace_back(static_cast<std::uint32_t>(index));
  });
  return ids;
}

const Keyframe* MapSnapshot::newest_keyframe(CameraId camera) const {
  for (std::uint32_t id = tables_.next_keyframe; id-- > 0;) {
    const Keyframe* keyframe = find(KeyframeId(id));
    if (keyframe != nullptr && keyframe->observations->camera == camera) return keyframe;
  }
  return nullptr;
}

const Keyframe* MapSnapshot::find_frame(CameraId camera, std::int64_t frame_index) const {
  for (std::uint32_t id = tables_.next_keyframe; id-- > 0;) {
    const Keyframe* keyframe = find(KeyframeId(id));
    if (keyframe == nullptr) continue;
    if (keyframe->observations->frame_index < frame_index) return nullptr;
    if (keyframe->observations->frame_index == frame_index &&
        keyframe->observations->camera == camera) {
      return keyframe;
    }
  }
  return nullptr;
}

std::int64_t MapSnapshot::newest_frame_index(CameraId camera) const {
  return tables_.newest_frame_index.at(camera.value);
}

Rigid3d MapSnapshot::cam_from_world(KeyframeId id) const {
  if (const Keyframe* keyframe = find(id)) return keyframe->cam_from_world;
  Rigid3d cam_from_ancestor;
  while (const ErasedKeyframe* erased = tables_.erased.find(id.value)) {
    cam_from_ancestor = cam_from_ancestor * erased->cam_from_parent;
    id = erased->parent;
  }
  return cam_from_ancestor * at(id).cam_from_world;
}

KeyframeId MapSnapshot::component(KeyframeId id) const {
  while (const ErasedKeyframe* erased = tables_.erased.find(id.value)) id = erased->parent;
  return at(id).component;
}

std::optional<Matrix6d> MapSnapshot::keyframe_covariance(KeyframeId id) const {
  if (covariances() == nullptr || !covariances()->knows(id)) return std::nullopt;
  return covariances()->covariance(id);
}

std::vector<Covisible> MapSnapshot::covisible(KeyframeId id, int min_shared,
                                              std::size_t limit) const {
  std::vector<Covisible> found;
  for (const Covisible& edge : at(id).covisible) {
    if (edge.shared_landmarks >= min_shared) found.push_back(edge);
  }
  std::sort(found.begin(), found.end(), [](const Covisible& a, const Covisible& b) {
    if (a.shared_landmarks != b.shared_landmarks) return a.shared_landmarks > b.shared_landmarks;
    return a.id < b.id;
  });
  if (found.size() > limit) found.resize(limit);
  return found;
}

}  // namespace hybrid_slam
