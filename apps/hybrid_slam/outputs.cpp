#include "apps/hybrid_slam/outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/hybrid_slam/version.h"
#include "apps/io/map_picture.h"
#include "apps/io/ply.h"
#include "apps/io/report.h"
#include "backend/map/map_file.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

struct Trajectories {
  Trajectory final_estimate;
  Trajectory online;
};

Trajectories collect(const RunResult& result) {
  Trajectories trajectories;
  for (const FrameRecord& record : result.records) {
    if (record.frame.tracked()) {
      trajectories.final_estimate.push_back(
          {record.frame.time, inverse(result.cam_from_world(record))});
      trajectories.online.push_back({record.frame.time, inverse(record.frame.cam_from_world)});
    }
  }
  return trajectories;
}

std::optional<AbsoluteError> evaluate(const SequenceInfo& sequence, const Trajectory& estimate) {
  if (sequence.truth.empty() || estimate.empty()) {
    return std::nullopt;
  }
  double shortest = 1;  // [s] between two frames
  for (std::size_t i = 1; i < sequence.times.size(); ++i) {
    shortest = std::min(shortest, sequence.times[i] - sequence.times[i - 1]);
  }
  return absolute_error(associate(estimate, sequence.truth, shortest / 4),
                        TrajectoryAlignment::kSe3);
}

MapPicture make_picture(const SequenceInfo& sequence, const RunResult& result,
                        const Trajectory& estimate, const std::optional<AbsoluteError>& ate) {
  MapPicture picture;
  picture.title = fmt::format("{}: {} keyframes, {} landmarks", sequence.name,
                              result.map->keyframe_count(), result.map->landmark_count());
  picture.points = landmark_positions(*result.map);
  for (const StampedPose& pose : estimate) {
    picture.path.emplace_back(pose.world_from_cam.translation());
  }
  if (ate) {
    const Sim3d estimate_from_truth = inverse(ate->truth_from_estimate);
    for (const StampedPose& pose : sequence.truth) {
      picture.truth.push_back(estimate_from_truth *
                              Eigen::Vector3d(pose.world_from_cam.translation()));
    }
  }
  return picture;
}

template <typename Key>
Json count_by(const RunResult& result, Key key) {
  Json counts = Json::object();
  for (const FrameRecord& record : result.records) {
    const std::string name = key(record.frame);
    counts[name] = counts.value(name, 0) + 1;
  }
  return counts;
}

Json options_json(const CommandLine& line) {
  const SlamOptions& options = line.options;
  return {{"mode", line.mode == RunMode::kRealtime ? "realtime" : "every-frame"},
          {"cameras", "stereo"},
          {"features", options.features},
          {"threads", line.threads},
          {"rate", line.rate},
          {"limit", line.limit},
          {"contrast_threshold", options.sift.contrast_threshold},
          {"upsample", options.sift.upsample},
          {"refine_stereo", options.stereo.refine},
          {"refine_tracks", options.tracking.refinement.enabled}};
}

Json summary_json(const CommandLine& line, const SequenceInfo& sequence, const RunResult& result,
                  const RunSummary& summary) {
  const FrameCounts& frames = result.frames;
  Json json;
  json["sequence"] = sequence.name;
  json["layout"] = sequence.layout;
  json["frames"] = {{"read", frames.read},
                    {"tracked", frames.tracked},
                    {"lost", frames.lost},
                    {"dropped", frames.dropped},
                    {"corrupt", frames.corrupt}};
  json["poses_from"] =
      count_by(result, [](const TrackedFrame& frame) { return to_string(frame.source); });
  json["predictions_from"] =
      count_by(result, [](const TrackedFrame& frame) { return to_string(frame.prediction); });
  json["keyframes"] = result.map->keyframe_count();
  json["landmarks"] = result.map->landmark_count();
  json["disparity_offset_px"] =
      result.records.empty() ? 0 : result.records.back().frame.disparity_offset;
  json["interrupted"] = result.cancelled;
  json["internal_errors"] = result.internal_errors;
  json["seconds"] = summary.seconds;
  json["ate"] = summary.ate ? to_json(*summary.ate) : Json();
  json["truth_convention"] =
      sequence.truth_convention.empty() ? Json() : Json(sequence.truth_convention);
  json["options"] = options_json(line);
  json["seed"] = line.options.seed;
  json["blas"] = blas_name();
  json["git_commit"] = kGitCommit;
  return json;
}

}  // namespace

void write_map(const CommandLine& line, const MapSnapshot& map) {
  save_map(
      std::filesystem::path(line.out) / "map.hslam", map,
      {fmt::format("hybrid_slam {} ({})", kVersion, kGitCommit), write_slam_options(line.options)});
}

RunSummary write_outputs(const CommandLine& line, const SequenceInfo& sequence,
                         const RunResult& result, double seconds) {
  const std::filesystem::path out = line.out;
  const Trajectories trajectories = collect(result);
  RunSummary summary;
  summary.seconds = seconds;
  summary.ate = evaluate(sequence, trajectories.final_estimate);
  write_tum(out / "stereo.tum", trajectories.final_estimate);
  write_tum(out / "stereo_online.tum", trajectories.online);
  write_map_ply(out / "map.ply", *result.map);
  write_map_picture(out / "map.png",
                    make_picture(sequence, result, trajectories.final_estimate, summary.ate));
  write_json(out / "timing.json", to_json(result.times));
  write_json(out / "summary.json", summary_json(line, sequence, result, summary));
  write_map(line, *result.map);  // the largest: where the disk gets full, the others are there
  return summary;
}

void print_summary(const CommandLine& line, const RunResult& result, const RunSummary& summary) {
  const FrameCounts& frames = result.frames;
  fmt::print("frames     {} read, {} tracked, {} lost, {} dropped, {} corrupt\n", frames.read,
             frames.tracked, frames.lost, frames.dropped, frames.corrupt);
  fmt::print("map        {} keyframes, {} landmarks\n", result.map->keyframe_count(),
             result.map->landmark_count());
  fmt::print("time       {:.1f} s, {:.2f} frames per second\n", summary.seconds,
             summary.seconds > 0 ? frames.read / summary.seconds : 0);
  if (summary.ate) {
    fmt::print("ATE        {:.5f} m RMSE over {} frames (SE3 alignment)\n",
               summary.ate->position.rmse, summary.ate->position.count);
    if (const auto ratio = summary.ate->length_ratio()) {
      fmt::print("length     {:.4f} of the true {:.2f} m\n", *ratio, summary.ate->true_length);
    }
  }
  fmt::print("written to {}\n", line.out);
}

}  // namespace hybrid_slam
