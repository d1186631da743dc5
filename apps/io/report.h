#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/io/hybrid_error.h"
#include "apps/io/stage_times.h"
#include "apps/io/trajectory.h"

namespace hybrid_slam {

// Smallest of the values, at least one, that `percent` of all do not exceed.
double percentile(std::vector<double> values, double percent);

// Per stage: count, mean, p50, p95, p99, max; durations in ms, percentiles by nearest rank, of an
// even sample where there are very many.
nlohmann::ordered_json to_json(const StageTimes& times);

// rmse, mean, median, max (all times `unit`), count.
nlohmann::ordered_json to_json(const ErrorStatistics& errors, double unit = 1);

// "position_m", "scale", "estimated_length_m", "true_length_m", "length_ratio".
nlohmann::ordered_json to_json(const AbsoluteError& error);

// "translation_m", "rotation_deg".
nlohmann::ordered_json to_json(const RelativeError& error);

// "translation_m", "rotation_deg", "registered", "total".
nlohmann::ordered_json to_json(const HybridError& error);

// Indented, whole or not at all. Throws OutputError.
void write_json(const std::filesystem::path& path, const nlohmann::ordered_json& json);

// File of the BLAS library in use, symbolic links resolved; "none" if the program has none.
std::string blas_name();

}  // namespace hybrid_slam
