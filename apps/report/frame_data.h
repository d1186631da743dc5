#pragma once

#include <cstddef>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/report/result_table.h"
#include "apps/report/run_story.h"

// What the page is told of frames. Arrays are those of page_arrays.h.

namespace hybrid_slam {

// Frames of both cameras in the page, and moments of the true path, at most.
inline constexpr std::size_t kPageFrames = 9000;

// Places of the frames that are shown: every n-th, and each that changed a camera's state.
std::vector<std::size_t> frames_to_show(const std::vector<RunFrame>& frames);

nlohmann::ordered_json frames_json(const RunStory& story);

// What summary.json says of all frames together: span_s, period_s, losses, cpu_ms and behind_ms of
// the stereo frames, error_by_state of each camera.
nlohmann::ordered_json story_json(const RunStory& story);

// errors.csv: the true path in the map's frame.
nlohmann::ordered_json truth_json(const ResultTable& errors);

}  // namespace hybrid_slam
