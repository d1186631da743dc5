#pragma once

#include <nlohmann/json.hpp>

#include "test/support/child_process.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {

using Json = nlohmann::json;

// map_optimizer, in `folder`.
Outcome run_optimizer(const TempFolder& folder, const std::vector<std::string>& arguments);

Json report_of(const TempFolder& folder, const std::string& out = "out");

// Ended with this code and one line of its own that holds the reason.
void check_refused(const Outcome& outcome, int code, const std::string& reason);

}  // namespace hybrid_slam
