#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/io/trajectory.h"

namespace hybrid_slam {

// How long each run of each stage took. One owner; the workers' are merged at the end.
class StageTimes {
 public:
  void add(std::string_view stage, double milliseconds);
  void merge(const StageTimes& other);

  // Stages in the order in which they were first added, with every duration [ms].
  const std::vector<std::pair<std::string, std::vector<double>>>& stages() const { return stages_; }

 private:
  std::vector<std::pair<std::string, std::vector<double>>> stages_;
};

// Adds the time from its making to its end.
class StageTimer {
 public:
  StageTimer(StageTimes& times, std::string_view stage) : times_(times), stage_(stage) {}
  ~StageTimer() {
    const std::chrono::duration<double, std::milli> elapsed =
        std::chrono::steady_clock::now() - start_;
    times_.add(stage_, elapsed.count());
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  StageTimes& times_;
  std::string stage_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Per stage: count, mean, p50, p95, p99, max; durations in ms, percentiles by nearest rank.
nlohmann::ordered_json to_json(const StageTimes& times);

// rmse, mean, median, max (all times `unit`), count.
nlohmann::ordered_json to_json(const ErrorStatistics& errors, double unit = 1);

// "position_m", "scale", "estimated_length_m", "true_length_m", "length_ratio".
nlohmann::ordered_json to_json(const AbsoluteError& error);

// "translation_m", "rotation_deg".
nlohmann::ordered_json to_json(const RelativeError& error);

// Indented, whole or not at all. Throws OutputError.
void write_json(const std::filesystem::path& path, const nlohmann::ordered_json& json);

// File of the BLAS library in use, symbolic links resolved; "none" if the program has none.
std::string blas_name();

}  // namespace hybrid_slam
