#pragma once

#include <memory>
#include <string>

#include <spdlog/logger.h>

namespace hybrid_slam {

// The rooms of a session that log. Each is an spdlog logger of that name, "hybrid_slam.tracking",
// say, whose level can be set by itself. Unless open_log() was called, or the program has
// registered loggers of these names itself, they say nothing.
enum class LogRoom { kInput, kTracking, kMapping, kLoops, kSession };

spdlog::logger& log_of(LogRoom room);

// Levels by their names: trace, debug, info, warning, error, off.
bool is_log_level(const std::string& level);

// From here on all rooms write into this file, line by line, beside what they did before. An older
// file is gone on with. Throws OutputError.
void open_log(const std::string& file, const std::string& level);

}  // namespace hybrid_slam
