#include "apps/map_tool/map_crop.h"

#include <fmt/format.h>

#include "backend/map/components.h"
#include "backend/map/map_assembly.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

constexpr int kSeenInBox = 15;

bool is_wanted(const Keyframe& keyframe, const CropOptions& options) {
  const double time = keyframe.observations->time;
  return time >= options.from.value_or(time) && time <= options.to.value_or(time) &&
         keyframe.component == options.component.value_or(keyframe.component);
}

bool is_in_box(const CropOptions& options, const Landmark& landmark) {
  return !options.box || options.box->contains(landmark.point_in_world);
}

bool sees_the_box(const MapSnapshot& map, const Keyframe& keyframe, const CropOptions& options) {
  if (!options.box) return true;
  int seen = 0;
  for (const LandmarkId id : keyframe.landmarks) {
    seen += id.valid() && is_in_box(options, map.at(id)) ? 1 : 0;
  }
  return seen >= kSeenInBox;
}

void check_component(const MapSnapshot& map, KeyframeId name) {
  std::string names;
  for (const auto& [known, size] : component_sizes(map)) {
    if (known == name) return;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", known.value);
  }
  throw InputError(fmt::format("no component {}: there are {}", name.value, names));
}

}  // namespace

Map crop_map(const MapSnapshot& map, const CropOptions& options) {
  if (options.component) check_component(map, *options.component);
  MapPart part;
  part.map = &map;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    if (is_wanted(keyframe, options) && sees_the_box(map, keyframe, options)) {
      part.keyframes.push_back(id);
    }
  }
  if (part.keyframes.empty()) throw InputError("nothing would be left: no keyframe fits");
  part.takes = [&](const Landmark& landmark) { return is_in_box(options, landmark); };
  return assemble_map({&part, 1});
}

}  // namespace hybrid_slam
