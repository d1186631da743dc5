#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "apps/io/report.h"
#include "apps/io/trajectory.h"
#include "apps/program/program.h"
#include "apps/trajectory_eval/hybrid.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

constexpr const char* kDescription =
    "Compares an estimated trajectory with the truth.\n"
    "Files: TUM (t tx ty tz qx qy qz qw), EuRoC (ns, position, qw qx qy qz, ...) or KITTI\n"
    "(3x4 row-major, no times), told by their header, columns and times.\n"
    "KITTI poses get the times of --times; without it they are paired by their number.";
constexpr const char* kFooter =
    "ate: distance between true and estimated positions after alignment of the whole\n"
    "rpe: error of the motion over --delta pairs; translation and rotation\n"
    "hybrid: pose of the fisheye relative to the left camera, moment by moment; EST is a folder "
    "with stereo.tum and fisheye.tum, TRUTH a UWslam sequence or its camera_poses.txt\n"
    "Exit codes: 0 ok, 1 internal error, 2 bad usage, 3 bad input.";

const std::map<std::string, TruthConvention> kTruthConventions{
    {"auto", TruthConvention::kAuto},
    {"world_from_cam", TruthConvention::kWorldFromCam},
    {"cam_from_world", TruthConvention::kCamFromWorld}};

const std::map<std::string, QuaternionOrder> kQuaternionOrders{{"xyzw", QuaternionOrder::kXyzw},
                                                               {"wxyz", QuaternionOrder::kWxyz}};

struct Options {
  std::string metric, estimate, truth, times;
  std::string align = "se3";
  double max_difference = 0.02;  // [s]
  std::size_t delta = 1;
  QuaternionOrder estimate_order = QuaternionOrder::kUnknown;
  QuaternionOrder truth_order = QuaternionOrder::kUnknown;
  TruthConvention convention = TruthConvention::kAuto;
  bool json = false;
};

void set_times(TrajectoryFile& file, const std::vector<double>& times, const Options& options) {
  if (file.has_times) return;
  if (times.size() < file.poses.size()) {
    throw InputError(options.times + ": has " + std::to_string(times.size()) + " times for " +
                     std::to_string(file.poses.size()) + " poses");
  }
  for (std::size_t i = 0; i < file.poses.size(); ++i) file.poses[i].time = times[i];
  file.has_times = true;
}

TrajectoryFile read_poses(const std::string& path, QuaternionOrder order) {
  TrajectoryFile file = read_trajectory(path, order);
  for (const std::string& note : file.notes) spdlog::warn(note);
  for (const std::string& warning : file.warnings) spdlog::warn(warning);
  return file;
}

std::string time_range(const std::string& path, const Trajectory& poses) {
  return fmt::format("{} from {:.3f} to {:.3f} s", path, poses.front().time, poses.back().time);
}

// With times on one side only, poses are paired by number if there are as many on both.
std::vector<PosePair> read_pairs(const Options& options) {
  TrajectoryFile estimate = read_poses(options.estimate, options.estimate_order);
  TrajectoryFile truth = read_poses(options.truth, options.truth_order);
  if (!options.times.empty()) {
    std::vector<std::string> warnings;
    const std::vector<double> times = read_times(options.times, warnings);
    for (const std::string& warning : warnings) spdlog::warn(warning);
    set_times(estimate, times, options);
    set_times(truth, times, options);
  }
  if (estimate.has_times != truth.has_times) {
    if (estimate.poses.size() != truth.poses.size()) {
      throw InputError(
          fmt::format("{}: {} poses, but {} has {} and one of them has no times; give "
                      "--times",
                      options.estimate, estimate.poses.size(), options.truth, truth.poses.size()));
    }
    for (std::size_t i = 0; i < truth.poses.size(); ++i) {
      truth.poses[i].time = estimate.poses[i].time;
    }
  }
  auto pairs = associate(estimate.poses, truth.poses, options.max_difference);
  if (pairs.empty()) {
    throw InputError(fmt::format("{}: no pose is within {} s of one of {}: {}, {}",
                                 options.estimate, options.max_difference, options.truth,
                                 time_range(options.estimate, estimate.poses),
                                 time_range(options.truth, truth.poses)));
  }
  return pairs;
}

void print(const char* name, const ErrorStatistics& errors, double unit, const char* unit_name) {
  fmt::print("{:<12} rmse {:.6f}  mean {:.6f}  median {:.6f}  max {:.6f}  [{}] ({} values)\n", name,
             unit * errors.rmse, unit * errors.mean, unit * errors.median, unit * errors.max,
             unit_name, errors.count);
}

void print_ratio(const AbsoluteError& error) {
  fmt::print("{:<12} estimate {:.4f} m, truth {:.4f} m", "path length", error.estimated_length,
             error.true_length);
  if (const auto ratio = error.length_ratio()) fmt::print(", ratio {:.6f}", *ratio);
  fmt::print("\n");
}

AbsoluteError aligned_error(const std::vector<PosePair>& pairs, const Options& options) {
  const TrajectoryAlignment alignment = options.align == "sim3"  ? TrajectoryAlignment::kSim3
                                        : options.align == "se3" ? TrajectoryAlignment::kSe3
                                                                 : TrajectoryAlignment::kNone;
  const auto error = absolute_error(pairs, alignment);
  if (!error) {
    throw InputError(fmt::format("{}: {} pairs cannot be aligned by {}", options.estimate,
                                 pairs.size(), options.align));
  }
  return *error;
}

void evaluate(const Options& options) {
  const std::vector<PosePair> pairs = read_pairs(options);
  nlohmann::ordered_json json = {
      {"metric", options.metric}, {"align", options.align}, {"pairs", pairs.size()}};
  if (options.metric == "ate") {
    const AbsoluteError absolute = aligned_error(pairs, options);
    json.update(to_json(absolute));
    if (!options.json) {
      print("position", absolute.position, 1, "m");
      print_ratio(absolute);
      if (options.align == "sim3") {
        fmt::print("{:<12} {:.6f}\n", "scale", absolute.truth_from_estimate.scale());
      }
    }
  } else {
    const double scale =
        options.align == "sim3" ? aligned_error(pairs, options).truth_from_estimate.scale() : 1;
    const auto relative = relative_error(pairs, options.delta, scale);
    if (!relative) {
      throw InputError(fmt::format("{}: {} pairs are too few for --delta {}", options.estimate,
                                   pairs.size(), options.delta));
    }
    json["delta"] = options.delta;
    json.update(to_json(*relative));
    if (!options.json) {
      print("translation", relative->translation, 1, "m");
      print("rotation", relative->rotation, 180 / std::numbers::pi, "deg");
    }
  }
  if (options.json) fmt::print("{}\n", json.dump(2));
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app(kDescription);
  app.footer(kFooter);
  app.add_option("METRIC", options.metric, "ate, rpe or hybrid")
      ->required()
      ->check(CLI::IsMember({"ate", "rpe", "hybrid"}));
  app.add_option("EST", options.estimate, "estimated trajectory")->required();
  app.add_option("TRUTH", options.truth, "true trajectory")->required();
  app.add_option("--align", options.align, "se3, sim3 or none (rpe: sim3 applies its scale)")
      ->check(CLI::IsMember({"se3", "sim3", "none"}))
      ->capture_default_str();
  app.add_option("--times", options.times, "times of KITTI poses, one per line [s]");
  app.add_option("--max-difference", options.max_difference, "largest difference in time [s]")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--delta", options.delta, "rpe: number of pairs that a motion spans")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  for (const auto& [name, order] : {std::pair("--est-quaternions", &options.estimate_order),
                                    std::pair("--truth-quaternions", &options.truth_order)}) {
    app.add_option(name, *order,
                   "order in EST or TRUTH, where the file (8 columns) does not tell it")
        ->transform(CLI::CheckedTransformer(kQuaternionOrders).description(""))
        ->option_text("xyzw|wxyz");
  }
  app.add_option("--gt-convention", options.convention,
                 "hybrid: how the poses of TRUTH are meant; auto (default) says which it took")
      ->transform(CLI::CheckedTransformer(kTruthConventions).description(""))
      ->option_text("auto|world_from_cam|cam_from_world");
  app.add_flag("--json", options.json, "print JSON");
  if (const auto end = parse_line(app, argc, argv)) {
    return *end;
  }
  if (options.metric == "hybrid") {
    evaluate_hybrid(options.estimate, options.truth, options.convention, options.max_difference,
                    options.json);
  } else {
    evaluate(options);
  }
  return kExitOk;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("trajectory_eval", [&] { return run(argc, argv); });
}
