#include "apps/io/report.h"

#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <nlohmann/json.hpp>

#include "cameras/files/output_file.h"

namespace hybrid_slam {

namespace {

using Json = nlohmann::ordered_json;

double percentile_of_sorted(const std::vector<double>& sorted, double percent) {
  const double rank = std::ceil(percent / 100 * static_cast<double>(sorted.size()));
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

}  // namespace

double percentile(std::vector<double> values, double percent) {
  std::sort(values.begin(), values.end());
  return percentile_of_sorted(values, percent);
}

Json to_json(const StageTimes& times) {
  Json json = Json::object();
  for (const auto& [stage, durations] : times.stages()) {
    std::vector<double> sorted = durations.kept();
    std::sort(sorted.begin(), sorted.end());
    json[stage] = {{"count", durations.count()},
                   {"mean", durations.mean()},
                   {"p50", percentile_of_sorted(sorted, 50)},
                   {"p95", percentile_of_sorted(sorted, 95)},
                   {"p99", percentile_of_sorted(sorted, 99)},
                   {"max", durations.max()}};
  }
  return json;
}

Json to_json(const ErrorStatistics& errors, double unit) {
  return {{"rmse", unit * errors.rmse},
          {"mean", unit * errors.mean},
          {"median", unit * errors.median},
          {"max", unit * errors.max},
          {"count", errors.count}};
}

Json to_json(const AbsoluteError& error) {
  Json json = {{"position_m", to_json(error.position)},
               {"scale", error.truth_from_estimate.scale()},
               {"estimated_length_m", error.estimated_length},
               {"true_length_m", error.true_length}};
  const std::optional<double> ratio = error.length_ratio();
  json["length_ratio"] = ratio ? Json(*ratio) : Json();
  return json;
}

Json to_json(const RelativeError& error) {
  return {{"translation_m", to_json(error.translation)},
          {"rotation_deg", to_json(error.rotation, 180 / std::numbers::pi)}};
}

Json to_json(const HybridError& error) {
  return {{"translation_m", to_json(error.translation)},
          {"rotation_deg", to_json(error.rotation, 180 / std::numbers::pi)},
          {"registered", error.registered},
          {"total", error.total}};
}

void write_json(const std::filesystem::path& path, const Json& json) {
  // Text from outside (a path, a warning) need not be valid UTF-8.
  write_file(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

std::string blas_name() {
  Dl_info info{};
  const void* const dgemm = dlsym(RTLD_DEFAULT, "dgemm_");
  if (dgemm == nullptr || dladdr(dgemm, &info) == 0 || info.dli_fname == nullptr) return "none";
  std::error_code error;
  const std::filesystem::path resolved = std::filesystem::canonical(info.dli_fname, error);
  return error ? std::string(info.dli_fname) : resolved.string();
}

}  // namespace hybrid_slam
