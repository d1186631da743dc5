#include "test/apps/map_tool/tool_maps.h"

#include <utility>

namespace hybrid_slam {

SyntheticSceneOptions small_orbit(int times, bool fisheye) {
  SyntheticSceneOptions options;
  options.times = times;
  options.landmarks = 1500;
  options.fisheye = fisheye;
  return options;
}

FilledMap map_of_frames(const SyntheticScene& scene, std::size_t first, std::size_t last,
                        std::size_t stride) {
  SyntheticScene part = scene;
  part.frames.clear();
  for (std::size_t i = first; i < std::min(last, scene.frames.size()); i += stride) {
    part.frames.push_back(scene.frames[i]);
  }
  FillOptions options;
  options.odometry = true;
  return fill_map(part, options);
}

MapTables tables_of(Map& map) {
  const auto snapshot = map.snapshot();
  const MapTables& from = MapFileAccess::tables(*snapshot);
  MapTables tables;
  tables.cameras = from.cameras;
  from.keyframes.for_each(
      [&](std::uint64_t i, const Keyframe& k) { tables.keyframes.insert(i, k); });
  from.landmarks.for_each(
      [&](std::uint64_t i, const Landmark& l) { tables.landmarks.insert(i, l); });
  tables.origin = from.origin;
  tables.next_keyframe = from.next_keyframe;
  tables.next_landmark = from.next_landmark;
  tables.newest_frame_index = from.newest_frame_index;
  tables.corrections = from.corrections;
  return tables;
}

}  // namespace hybrid_slam
