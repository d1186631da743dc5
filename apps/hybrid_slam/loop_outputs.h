#pragma once

#include <filesystem>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/slam/loop_closing.h"

namespace hybrid_slam {

// "proposed", "accepted", "rejected": by reason.
nlohmann::ordered_json to_json(const std::vector<LoopRecord>& loops);

// A line per proposed place: times of the two keyframes, outcome, how many matches were left at
// each step, and by how much the map was off. Throws OutputError.
void write_loops(const std::filesystem::path& path, const std::vector<LoopRecord>& loops);

}  // namespace hybrid_slam
