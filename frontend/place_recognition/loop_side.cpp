#include "frontend/place_recognition/loop_side.h"

#include <algorithm>

namespace hybrid_slam {
namespace {

bool knows_scale(const MapSnapshot& map, const Keyframe& keyframe, int min_shared) {
  const auto is_pair = [&](KeyframeId id) { return baseline(map.camera(map.at(id))) > 0; };
  return is_pair(keyframe.id) ||
         std::any_of(keyframe.covisible.begin(), keyframe.covisible.end(),
                     [&](const Covisible& near) {
                       return near.shared_landmarks >= min_shared && is_pair(near.id);
                     });
}

}  // namespace

KeyframeView::KeyframeView(const MapSnapshot& map, KeyframeId id)
    : keyframe(map.at(id)),
      camera(map.camera(keyframe)),
      observations(*keyframe.observations),
      grid(observations.features.keypoints, image_width(camera), image_height(camera)) {}

LoopSide::LoopSide(const MapSnapshot& map, KeyframeId id, int max_neighbours, int min_shared)
    : KeyframeView(map, id), metric(knows_scale(map, keyframe, min_shared)) {
  const auto add_landmarks_of = [&](const Keyframe& near) {
    std::copy_if(near.landmarks.begin(), near.landmarks.end(), std::back_inserter(landmarks),
                 [](LandmarkId landmark) { return landmark.valid(); });
  };
  add_landmarks_of(keyframe);
  for (const Covisible& near :
       map.covisible(id, min_shared, static_cast<std::size_t>(max_neighbours))) {
    neighbours.push_back(near.id);
    add_landmarks_of(map.at(near.id));
  }
  std::sort(landmarks.begin(), landmarks.end());
  landmarks.erase(std::unique(landmarks.begin(), landmarks.end()), landmarks.end());
}

}  // namespace hybrid_slam
