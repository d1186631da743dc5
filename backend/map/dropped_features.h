#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "backend/map/map_edit.h"
#include "backend/map/map_tables.h"

namespace hybrid_slam {

// Where a keypoint is among those that were kept, whose old indices these are, ascending; none if
// it was dropped.
std::optional<std::uint32_t> new_keypoint(std::span<const std::uint32_t> kept,
                                          std::uint32_t keypoint);

// Leaves a keyframe these of its features, ascending, among which are all that have a landmark.
void keep_features(MapTables& tables, KeyframeId id, const std::vector<std::uint32_t>& kept);

// The same of one that is not in the map yet; its new points are among the kept, too.
void keep_features(NewKeyframe& made, const std::vector<std::uint32_t>& kept);

}  // namespace hybrid_slam
