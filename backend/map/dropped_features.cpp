#include "backend/map/dropped_features.h"

#include <algorithm>
#include <memory>
#include <utility>

namespace hybrid_slam {

namespace {

template <typename T>
std::vector<T> chosen(const std::vector<T>& all, const std::vector<std::uint32_t>& kept) {
  std::vector<T> some;
  some.reserve(kept.size());
  for (const std::uint32_t i : kept) some.push_back(all[i]);
  return some;
}

std::shared_ptr<const FrameObservations> chosen(const FrameObservations& all,
                                                const std::vector<std::uint32_t>& kept) {
  auto some = std::make_shared<FrameObservations>();
  some->camera = all.camera;
  some->frame_index = all.frame_index;
  some->time = all.time;
  some->features.kind = all.features.kind;
  some->features.keypoints = chosen(all.features.keypoints, kept);
  some->features.descriptors = chosen(all.features.descriptors, kept);
  if (!all.u_right.empty()) some->u_right = chosen(all.u_right, kept);
  some->disparity_offset = all.disparity_offset;
  some->dropped = all.dropped + static_cast<std::uint32_t>(all.size() - kept.size());
  return some;
}

std::shared_ptr<const Odometry> renumbered(const Odometry& odometry,
                                           const std::vector<std::uint32_t>& kept) {
  Odometry now = odometry;
  now.keypoints.clear();
  for (const std::uint32_t keypoint : odometry.keypoints) {
    const auto place = new_keypoint(kept, keypoint);
    if (place) now.keypoints.push_back(*place);
  }
  now.keypoints.shrink_to_fit();
  now.dropped += static_cast<std::uint32_t>(odometry.keypoints.size() - now.keypoints.size());
  return std::make_shared<const Odometry>(std::move(now));
}

void renumber(Landmark& landmark, KeyframeId keyframe, std::uint32_t keypoint) {
  const auto seen = std::find_if(landmark.observations.begin(), landmark.observations.end(),
                                 [&](const Observation& o) { return o.keyframe == keyframe; });
  seen->keypoint = keypoint;
}

}  // namespace

std::optional<std::uint32_t> new_keypoint(std::span<const std::uint32_t> kept,
                                          std::uint32_t keypoint) {
  const auto place = std::lower_bound(kept.begin(), kept.end(), keypoint);
  if (place == kept.end() || *place != keypoint) return std::nullopt;
  return static_cast<std::uint32_t>(place - kept.begin());
}

void keep_features(MapTables& tables, KeyframeId id, const std::vector<std::uint32_t>& kept) {
  Keyframe& keyframe = tables.keyframes.edit(id.value);
  keyframe.observations = chosen(*keyframe.observations, kept);
  keyframe.landmarks = chosen(keyframe.landmarks, kept);
  if (keyframe.odometry != nullptr) keyframe.odometry = renumbered(*keyframe.odometry, kept);
  for (std::uint32_t keypoint = 0; keypoint < kept.size(); ++keypoint) {
    const LandmarkId landmark = keyframe.landmarks[keypoint];
    if (landmark.valid()) renumber(tables.landmarks.edit(landmark.value), id, keypoint);
  }
}

void keep_features(NewKeyframe& made, const std::vector<std::uint32_t>& kept) {
  made.observations = chosen(*made.observations, kept);
  made.landmarks = chosen(made.landmarks, kept);
  if (made.odometry != nullptr) made.odometry = renumbered(*made.odometry, kept);
  for (auto& [keypoint, point] : made.new_points) keypoint = new_keypoint(kept, keypoint).value();
}

}  // namespace hybrid_slam
