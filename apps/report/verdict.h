#pragma once

#include <nlohmann/json_fwd.hpp>

#include "apps/report/map_figures.h"
#include "apps/report/run_story.h"

namespace hybrid_slam {

// One line and its reasons: {"level", "text", "reasons": [{"kind", "text", "good"}]}. The level is
// "whole" (every frame has a pose in one map), "gaps", "parts" (several components, whose places
// against one another are not known), "nothing", or "unknown" without a summary. By what the run
// itself found: no bound is set here. `summary`: summary.json, or null.
nlohmann::ordered_json verdict(const nlohmann::ordered_json& summary, const RunStory& story,
                               const MapFigures& figures);

}  // namespace hybrid_slam
