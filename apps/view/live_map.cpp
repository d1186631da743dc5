#include "apps/view/live_map.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "apps/report/map_data.h"
#include "apps/report/page_arrays.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

std::uint32_t step_for(std::size_t count, std::size_t limit) {
  std::uint32_t step = 1;
  while (count / step > limit) step *= 2;
  return step;
}

Json landmarks_of(const MapSnapshot& map, std::span<const LandmarkId> ids, std::uint32_t step) {
  std::vector<LandmarkFigures> figures;
  std::vector<std::uint32_t> told, erased;
  std::vector<double> times;
  for (const LandmarkId id : ids) {
    if (id.value % step != 0) continue;
    const Landmark* const landmark = map.find(id);
    if (landmark == nullptr) {
      erased.push_back(id.value);
      continue;
    }
    const Keyframe& found_by = map.at(landmark->reference);
    told.push_back(id.value);
    times.push_back(found_by.observations->time);
    figures.push_back({landmark->point_in_world, baseline(map.camera(found_by)) > 0,
                       landmark->observations.size(), times.back(),
                       std::numeric_limits<double>::infinity()});
  }
  Json json = landmarks_json(figures, figures.size());
  json["of"] = map.landmark_count();
  json["id"] = page_array(told);
  json["time"] = page_array(times);
  json["erased"] = page_array(erased);
  return json;
}

Json keyframes_of(const MapSnapshot& map, std::span<const KeyframeId> ids, std::uint32_t step,
                  const RunStory& story) {
  std::vector<KeyframeFigures> figures;
  std::vector<std::uint32_t> erased;
  for (const KeyframeId id : ids) {
    if (id.value % step != 0) continue;
    const Keyframe* const keyframe = map.find(id);
    if (keyframe == nullptr) {
      erased.push_back(id.value);
      continue;
    }
    KeyframeFigures told;
    told.id = id;
    told.stereo = baseline(map.camera(*keyframe)) > 0;
    told.time = keyframe->observations->time;
    told.component = keyframe->component;
    told.world_from_cam = inverse(keyframe->cam_from_world);
    for (const LandmarkId landmark : keyframe->landmarks) {
      if (landmark.valid()) told.seen.push_back(landmark.value);
    }
    figures.push_back(std::move(told));
  }
  Json json = keyframes_json(figures, story);
  json["of"] = map.keyframe_count();
  json["erased"] = page_array(erased);
  return json;
}

}  // namespace

LiveSteps live_steps(const MapSnapshot& map) {
  return {step_for(map.landmark_count(), kPageLandmarks),
          step_for(map.keyframe_count(), kPageKeyframes)};
}

Json live_map_json(const MapSnapshot& map, const RunStory& story, const LiveSteps& steps) {
  return {{"landmarks", landmarks_of(map, map.landmark_ids(), steps.landmarks)},
          {"keyframes", keyframes_of(map, map.keyframe_ids(), steps.keyframes, story)}};
}

Json live_map_change_json(const MapSnapshot& map, const MapSnapshot& since,
                          const LiveSteps& steps) {
  const std::vector<LandmarkId> landmarks = map.changed_landmarks(since);
  const std::vector<KeyframeId> keyframes = map.changed_keyframes(since);
  if (landmarks.empty() && keyframes.empty()) return Json();
  return {{"landmarks", landmarks_of(map, landmarks, steps.landmarks)},
          {"keyframes", keyframes_of(map, keyframes, steps.keyframes, RunStory())}};
}

}  // namespace hybrid_slam
