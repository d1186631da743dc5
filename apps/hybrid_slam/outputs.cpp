#include "apps/hybrid_slam/outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "apps/hybrid_slam/loop_outputs.h"
#include "apps/io/map_picture.h"
#include "apps/io/ply.h"
#include "apps/io/report.h"
#include "apps/slam/version.h"
#include "backend/map/map_file.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

struct Trajectories {
  Trajectory final_estimate;
  Trajectory online;
};

Trajectories collect(const RunResult& result, const std::vector<FrameRecord>& records) {
  Trajectories trajectories;
  for (const FrameRecord& record : records) {
    if (record.frame.tracked()) {
      if (record.in_main) {
        trajectories.final_estimate.push_back(
            {record.frame.time, inverse(result.cam_from_world(record))});
      }
      trajectories.online.push_back({record.frame.time, inverse(record.frame.cam_from_world)});
    }
  }
  return trajectories;
}

// A quarter of the shortest time between two frames [s].
double max_difference(const SequenceInfo& sequence) {
  double shortest = 1;
  for (std::size_t i = 1; i < sequence.times.size(); ++i) {
    shortest = std::min(shortest, sequence.times[i] - sequence.times[i - 1]);
  }
  return shortest / 4;
}

std::optional<AbsoluteError> evaluate(const SequenceInfo& sequence, const Trajectory& estimate) {
  if (sequence.truth.empty() || estimate.empty()) {
    return std::nullopt;
  }
  return absolute_error(associate(estimate, sequence.truth, max_difference(sequence)),
                        TrajectoryAlignment::kSe3);
}

// Against the true poses of the frames that were read.
std::optional<HybridError> evaluate_hybrid(const SequenceInfo& sequence, const RunResult& result,
                                           const Trajectory& stereo, const Trajectory& fisheye) {
  if (!sequence.fisheye || !sequence.truth_has_rotation || result.records.empty()) {
    return std::nullopt;
  }
  const double difference = max_difference(sequence);
  std::vector<StampedPose> true_fisheye;
  for (const StampedPose& pose : sequence.fisheye_truth) {
    if (pose.time <= result.records.back().frame.time + difference) true_fisheye.push_back(pose);
  }
  return hybrid_error(stereo, fisheye, sequence.truth, true_fisheye, difference);
}

std::vector<Eigen::Vector3d> positions(const Trajectory& trajectory,
                                       const Sim3d& picture_from_world = Sim3d()) {
  std::vector<Eigen::Vector3d> points;
  for (const StampedPose& pose : trajectory) {
    points.push_back(picture_from_world * Eigen::Vector3d(pose.world_from_cam.translation()));
  }
  return points;
}

MapPicture make_picture(const SequenceInfo& sequence, const RunResult& result,
                        const Trajectory& stereo, const Trajectory& fisheye,
                        const std::optional<AbsoluteError>& ate) {
  MapPicture picture;
  picture.title = fmt::format("{}: {} keyframes, {} landmarks", sequence.name,
                              result.map->keyframe_count(), result.map->landmark_count());
  MapPositions of_stereo = stereo_positions(*result.map);
  MapPositions of_fisheye = fisheye_positions(*result.map);
  picture.points = std::move(of_stereo.landmarks);
  picture.keyframes = std::move(of_stereo.keyframes);
  picture.path = positions(stereo);
  picture.fisheye_points = std::move(of_fisheye.landmarks);
  picture.fisheye_keyframes = std::move(of_fisheye.keyframes);
  picture.fisheye_path = positions(fisheye);
  if (ate) {
    const Sim3d estimate_from_truth = inverse(ate->truth_from_estimate);
    picture.truth = positions(sequence.truth, estimate_from_truth);
    if (sequence.fisheye) {
      picture.fisheye_truth = positions(sequence.fisheye_truth, estimate_from_truth);
    }
  }
  return picture;
}

template <typename Key>
Json count_by(const std::vector<FrameRecord>& records, Key key) {
  Json counts = Json::object();
  for (const FrameRecord& record : records) {
    const std::string name = key(record.frame);
    counts[name] = counts.value(name, 0) + 1;
  }
  return counts;
}

Json options_json(const CommandLine& line, const RunResult& result, bool hybrid) {
  const SlamOptions& options = line.options;
  return {{"mode", line.mode == SessionMode::kRealtime ? "realtime" : "every-frame"},
          {"cameras", hybrid ? "hybrid" : "stereo"},
          {"features", options.features},
          {"threads", line.threads},
          {"rate", line.rate},
          {"limit", line.limit},
          {"loops", options.loops.enabled},
          {"map", line.map.empty() ? Json() : Json(line.map)},
          {"localize", line.localize},
          {"contrast_threshold", options.sift.contrast_threshold},
          {"upsample", result.upsampled},
          {"refine_stereo", options.stereo.refine},
          {"refine_tracks", options.tracking.refinement.enabled}};
}

// "states" and "causes": how many frames had each; all states, and the causes that there were.
void add_conditions(Json& json, const FrameConditions& conditions) {
  Json& states = json["states"] = Json::object();
  for (const TrackingState state :
       {TrackingState::kStarting, TrackingState::kMap, TrackingState::kOdometry,
        TrackingState::kRelocalised, TrackingState::kLost}) {
    const auto found = conditions.states.find(to_string(state));
    states[to_string(state)] = found == conditions.states.end() ? 0 : found->second;
  }
  json["causes"] = conditions.causes.empty() ? Json::object() : Json(conditions.causes);
}

// What a fisheye adds to the summary.
Json fisheye_json(const RunResult& result, const RunSummary& summary) {
  const FrameCounts& frames = result.fisheye_frames;
  const MapPositions found = fisheye_positions(*result.map);
  Json json;
  json["frames"] = {{"read", frames.read},       {"registered", frames.tracked},
                    {"coasted", frames.coasted}, {"other_components", frames.other_components},
                    {"lost", frames.lost},       {"missing", frames.corrupt}};
  json["poses_from"] = count_by(result.fisheye_records,
                                [](const RecordedFrame& frame) { return to_string(frame.source); });
  add_conditions(json, result.fisheye_conditions);
  json["keyframes"] = found.keyframes.size();
  json["landmarks"] = found.landmarks.size();
  json["relative_pose_error"] = summary.hybrid ? to_json(*summary.hybrid) : Json();
  return json;
}

Json to_json(const UpsamplingEvidence& evidence, bool upsample) {
  return {{"on", upsample},
          {"chosen_by", evidence.chosen_by},
          {"features", evidence.features},
          {"feature_size_mrad", 1e3 * evidence.feature_size}};
}

Json summary_json(const CommandLine& line, const SequenceInfo& sequence, const RunResult& result,
                  const RunSummary& summary) {
  const FrameCounts& frames = result.frames;
  Json json;
  json["sequence"] = sequence.name;
  json["layout"] = sequence.layout;
  json["frames"] = {{"read", frames.read},       {"tracked", frames.tracked},
                    {"coasted", frames.coasted}, {"other_components", frames.other_components},
                    {"lost", frames.lost},       {"dropped", frames.dropped},
                    {"corrupt", frames.corrupt}};
  json["poses_from"] =
      count_by(result.records, [](const RecordedFrame& frame) { return to_string(frame.source); });
  json["predictions_from"] = count_by(
      result.records, [](const RecordedFrame& frame) { return to_string(frame.prediction); });
  add_conditions(json, result.conditions);
  json["keyframes"] = result.map->keyframe_count();
  json["landmarks"] = result.map->landmark_count();
  json["components"] = result.components;
  json["loops"] = to_json(result.loops);
  if (sequence.fisheye) json["fisheye"] = fisheye_json(result, summary);
  json["disparity_offset_px"] =
      result.records.empty() ? 0 : result.records.back().frame.disparity_offset;
  json["shading_depth_per_size"] = result.records.empty() ? 0 : result.records.back().frame.shading;
  json["interrupted"] = result.cancelled;
  json["internal_errors"] = result.internal_errors;
  json["seconds"] = summary.seconds;
  json["ate"] = summary.ate ? to_json(*summary.ate) : Json();
  json["truth_convention"] =
      sequence.truth_convention.empty() ? Json() : Json(sequence.truth_convention);
  json["upsampling"] = to_json(result.upsampling.value_or(UpsamplingEvidence()), result.upsampled);
  json["options"] = options_json(line, result, sequence.fisheye.has_value());
  json["seed"] = line.options.seed;
  json["sift_engine"] = to_string(line.device);
  json["blas"] = blas_name();
  json["git_commit"] = kGitCommit;
  return json;
}

void write_frame_times(const std::filesystem::path& path, const std::vector<FrameRecord>& records) {
  std::string text = "time,cpu_ms\n";
  for (const FrameRecord& record : records) {
    text += fmt::format("{:.6f},{:.3f}\n", record.frame.time, record.cpu_ms);
  }
  write_file(path, text);
}

}  // namespace

void write_map(const CommandLine& line, const MapSnapshot& map, const MapFileInfo& info) {
  save_map(std::filesystem::path(line.out) / "map.hslam", map, info);
}

RunSummary write_outputs(const CommandLine& line, const SequenceInfo& sequence,
                         const RunResult& result, double seconds) {
  const std::filesystem::path out = line.out;
  const Trajectories stereo = collect(result, result.records);
  const Trajectories fisheye = collect(result, result.fisheye_records);
  RunSummary summary;
  summary.seconds = seconds;
  summary.ate = evaluate(sequence, stereo.final_estimate);
  summary.hybrid = evaluate_hybrid(sequence, result, stereo.final_estimate, fisheye.final_estimate);
  write_tum(out / "stereo.tum", stereo.final_estimate);
  write_tum(out / "stereo_online.tum", stereo.online);
  if (sequence.fisheye) {
    write_tum(out / "fisheye.tum", fisheye.final_estimate);
    write_tum(out / "fisheye_online.tum", fisheye.online);
  }
  write_map_ply(out / "map.ply", *result.map);
  write_map_picture(out / "map.png", make_picture(sequence, result, stereo.final_estimate,
                                                  fisheye.final_estimate, summary.ate));
  write_loops(out / "loops.csv", result.loops);
  write_json(out / "timing.json", to_json(result.times));
  write_frame_times(out / "timing.csv", result.records);
  write_json(out / "summary.json", summary_json(line, sequence, result, summary));
  if (!line.localize) {
    write_map(line, *result.map,
              result.file_info);  // the largest: where the disk gets full, the others are there
  }
  return summary;
}

void print_summary(const CommandLine& line, const RunResult& result, const RunSummary& summary) {
  const FrameCounts& frames = result.frames;
  fmt::print("frames     {} read, {} tracked, {} lost, {} dropped, {} corrupt\n", frames.read,
             frames.tracked, frames.lost, frames.dropped, frames.corrupt);
  if (frames.coasted > 0) fmt::print("coasted    {} frames\n", frames.coasted);
  if (summary.hybrid || result.fisheye_frames.read > 0) {
    const FrameCounts& fisheye = result.fisheye_frames;
    fmt::print("fisheye    {} read, {} registered, {} lost, {} missing\n", fisheye.read,
               fisheye.tracked, fisheye.lost, fisheye.corrupt);
  }
  fmt::print("map        {} keyframes, {} landmarks\n", result.map->keyframe_count(),
             result.map->landmark_count());
  if (result.components > 1) {
    fmt::print("components {}; {} frames have poses in others than the one with most\n",
               result.components, frames.other_components);
  }
  if (!result.loops.empty()) {
    const Json loops = to_json(result.loops);
    fmt::print("loops      {} places proposed, {} closed\n", loops["proposed"].get<int>(),
               loops["accepted"].get<int>());
  }
  fmt::print("time       {:.1f} s, {:.2f} frames per second\n", summary.seconds,
             summary.seconds > 0 ? frames.read / summary.seconds : 0);
  if (summary.ate) {
    fmt::print("ATE        {:.5f} m RMSE over {} frames (SE3 alignment)\n",
               summary.ate->position.rmse, summary.ate->position.count);
    if (const auto ratio = summary.ate->length_ratio()) {
      fmt::print("length     {:.4f} of the true {:.2f} m\n", *ratio, summary.ate->true_length);
    }
  }
  if (summary.hybrid) {
    constexpr double kDegrees = 180 / std::numbers::pi;
    const HybridError& hybrid = *summary.hybrid;
    fmt::print(
        "arm        {:.4f} cm, {:.4f} deg mean; {:.4f} cm, {:.4f} deg median (fisheye from "
        "left, {} of {} frames)\n",
        100 * hybrid.translation.mean, kDegrees * hybrid.rotation.mean,
        100 * hybrid.translation.median, kDegrees * hybrid.rotation.median, hybrid.registered,
        hybrid.total);
  }
  fmt::print("written to {}\n", line.out);
}

}  // namespace hybrid_slam
