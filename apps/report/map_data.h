#pragma once

#include <cstddef>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/report/coverage.h"
#include "apps/report/map_figures.h"
#include "apps/report/run_story.h"
#include "cameras/camera.h"

// What the page is told of the map. Arrays are those of page_arrays.h.

namespace hybrid_slam {

inline constexpr std::size_t kPageKeyframes = 2500;  // in the page, at most
inline constexpr std::size_t kPageLandmarks = 100'000;

// The covariances are those of the story's frames that became keyframes.
nlohmann::ordered_json keyframes_json(const std::vector<KeyframeFigures>& keyframes,
                                      const RunStory& story);

// At most `limit` of them, evenly. sigma in units of 0.05 mm; 65535: more than that, or unknown.
nlohmann::ordered_json landmarks_json(const std::vector<LandmarkFigures>& landmarks,
                                      std::size_t limit);

nlohmann::ordered_json coverage_grid_json(const Coverage& coverage);
nlohmann::ordered_json residual_grids_json(const MapFigures& figures);
nlohmann::ordered_json cameras_json(const std::vector<Camera>& cameras);

}  // namespace hybrid_slam
