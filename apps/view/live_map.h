#pragma once

#include <cstdint>

#include <nlohmann/json_fwd.hpp>

#include "apps/report/run_story.h"
#include "backend/map/map_snapshot.h"

// What is told of a map that grows: all of it, then what changed. Landmarks and keyframes are told
// by their ids; where there are too many for a page, those whose id is divisible by a step.

namespace hybrid_slam {

struct LiveSteps {
  std::uint32_t landmarks = 1;
  std::uint32_t keyframes = 1;
  bool operator==(const LiveSteps&) const = default;
};

// Powers of two, with which no more are told than fit into a page.
LiveSteps live_steps(const MapSnapshot& map);

// {"landmarks": {..., "id", "time"}, "keyframes": {...}} with the columns of the report's data;
// sigma and residuals are not known. The covariances are those of the story's frames.
nlohmann::ordered_json live_map_json(const MapSnapshot& map, const RunStory& story,
                                     const LiveSteps& steps);

// The same of what changed, with "erased": ids. Null where nothing did that is told.
nlohmann::ordered_json live_map_change_json(const MapSnapshot& map, const MapSnapshot& since,
                                            const LiveSteps& steps);

}  // namespace hybrid_slam
