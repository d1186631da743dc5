#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "apps/dataset_check/dataset_check.h"

namespace hybrid_slam {

// For people: one line per subject, what was found last.
std::string to_text(const DatasetCheck& check);

// The same as numbers; docs/datasets.md names the keys.
nlohmann::ordered_json to_json(const DatasetCheck& check);

}  // namespace hybrid_slam
