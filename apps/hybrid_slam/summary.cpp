#include "apps/hybrid_slam/summary.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "apps/hybrid_slam/loop_outputs.h"
#include "apps/hybrid_slam/provenance.h"
#include "apps/io/ply.h"
#include "apps/io/report.h"
#include "apps/report/frame_data.h"
#include "apps/slam/version.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

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
          {"limit", line.input.limit},
          {"start", line.input.start},
          {"every", line.input.every},
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
                    {"lost", frames.lost},       {"missing", frames.corrupt},
                    {"dropped", frames.dropped}};
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

}  // namespace

Json summary_json(const CommandLine& line, const RunInput& input, const RunResult& result,
                  const RunSummary& summary, const FigureTables& tables) {
  const SequenceInfo& sequence = input.info();
  const FrameCounts& frames = result.frames;
  Json json;
  json["sequence"] = sequence.name;
  json["dataset"] = input.dataset();
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
  json["disparity_offset_px"] = result.disparity_offset;
  json["shading_depth_per_size"] = result.shading;
  json["interrupted"] = result.cancelled;
  json["internal_errors"] = result.internal_errors;
  json["seconds"] = summary.seconds;
  json["ate"] = summary.ate ? to_json(*summary.ate) : Json();
  json.update(story_json(tables.story));
  json["truth_convention"] =
      sequence.truth_convention.empty() ? Json() : Json(sequence.truth_convention);
  json["upsampling"] = to_json(result.upsampling.value_or(UpsamplingEvidence()), result.upsampled);
  json["options"] = options_json(line, result, sequence.fisheye.has_value());
  json["seed"] = line.options.seed;
  json["sift_engine"] = to_string(line.device);
  json["blas"] = blas_name();
  json["git_commit"] = kGitCommit;
  json["options_changed"] = changed_options(result.file_info.options);
  json["images_xxh3"] = input.checksum();
  json["calibration"] = to_json(tables.calibration);
  json["residuals"] = residuals_json(tables.figures);
  json["landmark_sigma_mm"] = landmark_sigma_json(tables.figures);
  json["coverage"] = to_json(tables.coverage, tables.figures);
  if (const Json live = input.live(); !live.is_null()) json["live"] = live;
  return json;
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
