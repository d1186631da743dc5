#include "apps/trajectory_eval/hybrid.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/io/hybrid_error.h"
#include "apps/io/report.h"
#include "apps/io/trajectory.h"
#include "frontend/input/camera_poses.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) fmt::print(stderr, "trajectory_eval: {}\n", warning);
}

// Times by the dataset's own script, which has no others: three images in a second.
std::vector<double> nominal_times(const fs::path& truth, std::vector<std::string>& warnings) {
  const std::vector<NumberRow> rows = read_number_rows(truth, ' ');
  std::vector<double> times;
  const double last = rows.empty() ? 0 : std::clamp(rows.back().values.front(), 0.0, 1e7);
  for (int i = 0; i <= last; ++i) times.push_back(i / 3.0);
  warnings.push_back(truth.string() + ": no times.txt beside it; index / 3 s is taken");
  return times;
}

CameraPoses read_truth(const fs::path& given, TruthConvention convention) {
  const fs::path file = fs::is_directory(given) ? given / "camera_poses.txt" : given;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const fs::path plural = folder / "times.txt";
  const fs::path singular = folder / "time.txt";
  std::vector<std::string> warnings;
  const bool has_times = fs::exists(plural) || fs::exists(singular);
  const auto times = has_times ? read_times(fs::exists(plural) ? plural : singular, warnings)
                               : nominal_times(file, warnings);
  CameraPoses poses = read_camera_poses(file, times, convention);
  poses.warnings.insert(poses.warnings.begin(), warnings.begin(), warnings.end());
  return poses;
}

Trajectory read_estimate(const fs::path& path) {
  TrajectoryFile file = read_trajectory(path);
  if (!file.has_times) throw InputError(path.string() + ": has no times");
  print_warnings(file.notes);
  print_warnings(file.warnings);
  return std::move(file.poses);
}

void print_errors(const char* name, const ErrorStatistics& errors, double unit,
                  const char* unit_name) {
  fmt::print("{:<12} mean {:.4f}  median {:.4f}  rmse {:.4f}  max {:.4f}  [{}] ({} values)\n", name,
             unit * errors.mean, unit * errors.median, unit * errors.rmse, unit * errors.max,
             unit_name, errors.count);
}

}  // namespace

void evaluate_hybrid(const std::string& estimate, const std::string& truth,
                     TruthConvention convention, double max_difference, bool json) {
  const Trajectory stereo = read_estimate(fs::path(estimate) / "stereo.tum");
  const Trajectory fisheye = read_estimate(fs::path(estimate) / "fisheye.tum");
  const CameraPoses poses = read_truth(truth, convention);
  print_warnings(poses.warnings);
  const auto error = hybrid_error(stereo, fisheye, poses.stereo, poses.fisheye, max_difference);
  if (!error) {
    throw InputError(fmt::format("{}: no moment has both poses within {} s of {}", estimate,
                                 max_difference, truth));
  }
  if (json) {
    nlohmann::ordered_json report = {{"metric", "hybrid"}, {"convention", poses.convention}};
    report.update(to_json(*error));
    fmt::print("{}\n", report.dump(2));
    return;
  }
  fmt::print("{:<12} {}\n", "convention", poses.convention);
  print_errors("translation", error->translation, 100, "cm");
  print_errors("rotation", error->rotation, 180 / std::numbers::pi, "deg");
  const double share = static_cast<double>(error->registered) / static_cast<double>(error->total);
  fmt::print("{:<12} {} of {} fisheye frames ({:.1f} %)\n", "registered", error->registered,
             error->total, 100 * share);
}

}  // namespace hybrid_slam
