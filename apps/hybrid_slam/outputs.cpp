#include "apps/hybrid_slam/outputs.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/hybrid_slam/calibration_outputs.h"
#include "apps/hybrid_slam/error_table.h"
#include "apps/hybrid_slam/loop_outputs.h"
#include "apps/hybrid_slam/summary.h"
#include "apps/io/map_picture.h"
#include "apps/io/ply.h"
#include "apps/io/report.h"
#include "apps/report/report.h"
#include "backend/map/map_file.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

// Of the component that holds most of the frames, as the map has them at the end.
Trajectory collect(const RunResult& result, const std::vector<FrameRecord>& records) {
  Trajectory trajectory;
  for (const FrameRecord& record : records) {
    if (!record.frame.tracked() || !record.in_main) continue;
    trajectory.push_back({record.frame.time, inverse(result.cam_from_world(record))});
  }
  return trajectory;
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

// Read from the files that are there already; empty if one of them was cut off.
RunStory story_of(const std::filesystem::path& out, const MapSnapshot& map) {
  try {
    return read_story(out, &map);
  } catch (const InputError& error) {
    spdlog::warn("summary.json tells of no losses: {}", error.what());
    return {};
  }
}

FigureTables write_tables(const std::filesystem::path& out, const RunResult& result) {
  const MapSnapshot& map = *result.map;
  FigureTables tables;
  tables.figures = map_figures(map);
  tables.coverage = find_coverage(tables.figures);
  write_keyframes(out / "keyframes.csv", tables.figures);
  write_residuals(out / "residuals.csv", tables.figures);
  write_coverage(out / "coverage.csv", tables.coverage);
  tables.calibration = calibration_figures(map, result.rig.get());
  write_calibration(out / "calibration.csv", map, tables.calibration);
  for (const std::string& change : tables.calibration.changes) {
    spdlog::warn("the rig is not as the map says, which this run does not follow: {}", change);
  }
  // Two streams of which one is seconds late look like this.
  for (const std::string& reason : tables.calibration.reasons) {
    spdlog::warn(
        "the rig should be calibrated again, unless left and right are of different moments: {}",
        reason);
  }
  tables.story = story_of(out, map);
  return tables;
}

// From the files that are there already. Nothing of the run depends on it: if one of them was cut
// off by a full disk, say, or the page cannot be written, there is a warning instead.
void write_report_of(const CommandLine& line, const ImageSequence* images, const RunResult& result,
                     const MapFigures& figures) {
  const std::filesystem::path page = std::filesystem::path(line.out) / "report.html";
  std::error_code ignored;
  std::filesystem::remove(page, ignored);  // an older run's
  if (!line.report) return;
  ReportSources sources;
  sources.folder = line.out;
  sources.map = result.map.get();
  sources.info = &result.file_info;
  sources.figures = &figures;
  sources.sequence = images;
  try {
    write_report(page, sources);
  } catch (const InputError& error) {
    spdlog::warn("no report: {}", error.what());
  } catch (const OutputError& error) {
    spdlog::warn("no report: {}", error.what());
  }
}

}  // namespace

void write_map(const CommandLine& line, const MapSnapshot& map, const MapFileInfo& info) {
  save_map(std::filesystem::path(line.out) / "map.hslam", map, info);
}

RunSummary write_outputs(const CommandLine& line, RunInput& input, const RunResult& result,
                         double seconds) {
  const SequenceInfo& sequence = input.info();
  const std::filesystem::path out = line.out;
  const Trajectory stereo = collect(result, result.records);
  const Trajectory fisheye = collect(result, result.fisheye_records);
  RunSummary summary;
  summary.seconds = seconds;
  summary.ate = evaluate(sequence, stereo);
  summary.hybrid = evaluate_hybrid(sequence, result, stereo, fisheye);
  write_tum(out / "stereo.tum", stereo);
  if (sequence.fisheye) write_tum(out / "fisheye.tum", fisheye);
  write_map_ply(out / "map.ply", *result.map);
  write_map_picture(out / "map.png", make_picture(sequence, result, stereo, fisheye, summary.ate));
  write_loops(out / "loops.csv", result.loops);
  write_json(out / "timing.json", to_json(result.times));
  std::vector<ErrorsOfCamera> compared;
  if (summary.ate) {
    compared = {{"stereo", stereo, sequence.truth}, {"fisheye", fisheye, sequence.fisheye_truth}};
  }
  write_errors(out / "errors.csv", compared,
               summary.ate ? summary.ate->truth_from_estimate : Sim3d(), max_difference(sequence));
  const FigureTables tables = write_tables(out, result);
  write_json(out / "summary.json", summary_json(line, input, result, summary, tables));
  write_report_of(line, input.pictures(), result, tables.figures);
  if (!line.localize) {
    write_map(line, *result.map,
              result.file_info);  // the largest: where the disk gets full, the others are there
  }
  return summary;
}

}  // namespace hybrid_slam
