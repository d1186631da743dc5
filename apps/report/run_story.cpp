#include "apps/report/run_story.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "apps/report/result_table.h"

namespace hybrid_slam {
namespace {

// Times of all tables meet here, however many digits they have.
long long microseconds(double time) { return std::llround(1e6 * time); }

std::optional<Rigid3d> pose_at(const ResultTable& table, std::size_t row,
                               const std::string& prefix) {
  const auto value = [&](const char* name) { return table.number(row, prefix + name); };
  const Eigen::Vector3d translation(value("tx"), value("ty"), value("tz"));
  const Eigen::Quaterniond rotation(value("qw"), value("qx"), value("qy"), value("qz"));
  if (!translation.allFinite() || !(rotation.norm() > 0.5)) return std::nullopt;
  return Rigid3d(rotation, translation);
}

std::optional<KeyframeId> keyframe_at(const ResultTable& table, std::size_t row,
                                      std::string_view column) {
  const double id = table.number(row, column);
  if (!(id >= 0 && id < KeyframeId::kInvalid)) return std::nullopt;
  return KeyframeId(static_cast<std::uint32_t>(id));
}

// The keyframe that a frame became.
const Keyframe* keyframe_of(const ResultTable& table, std::size_t row, const MapSnapshot& map) {
  const double index = table.number(row, "index");
  if (!(index >= 0)) return nullptr;
  const bool stereo = table.text(row, "camera") != "fisheye";
  for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
    const CameraId camera(i);
    if ((baseline(map.camera(camera)) > 0) != stereo) continue;
    const Keyframe* const found = map.find_frame(camera, static_cast<std::int64_t>(index));
    if (found != nullptr) return found;
  }
  return nullptr;
}

// The map's, through the keyframe that the frame follows. One that begins a component follows none,
// but has become a keyframe.
std::optional<Rigid3d> final_pose(const ResultTable& table, std::size_t row,
                                  const MapSnapshot* map) {
  const auto online = pose_at(table, row, "");
  const auto reference = keyframe_at(table, row, "reference");
  const auto reference_from_cam = pose_at(table, row, "reference_");
  if (map != nullptr && online && !reference) {
    const Keyframe* const own = keyframe_of(table, row, *map);
    return own != nullptr ? inverse(own->cam_from_world) : online;
  }
  if (map == nullptr || !online || !reference || !reference_from_cam ||
      *reference >= map->next_keyframe_id()) {
    return online;
  }
  return inverse(map->cam_from_world(*reference)) * *reference_from_cam;
}

RunFrame frame_at(const ResultTable& table, std::size_t row, const MapSnapshot* map) {
  RunFrame frame;
  frame.stereo = table.text(row, "camera") != "fisheye";
  frame.time = table.number(row, "time");
  frame.state = table.text(row, "state");
  frame.source = table.text(row, "source");
  frame.prediction = table.text(row, "prediction");
  frame.causes = table.text(row, "causes");
  frame.world_from_cam = final_pose(table, row, map);
  frame.sigma_position = table.number(row, "sigma_position");
  frame.sigma_rotation = table.number(row, "sigma_rotation_deg");
  frame.features = table.number(row, "features");
  frame.stereo_matches = table.number(row, "stereo_matches");
  frame.inliers = table.number(row, "inliers");
  frame.odometer = table.number(row, "odometer_inliers");
  frame.component = table.number(row, "component");
  frame.row_error = table.number(row, "row_error_px");
  constexpr std::array kColumns = {"cov_x_x", "cov_x_y", "cov_x_z",
                                   "cov_y_y", "cov_y_z", "cov_z_z"};
  for (std::size_t i = 0; i < kColumns.size(); ++i) {
    frame.covariance[i] = table.number(row, kColumns[i]);
  }
  frame.covariance_base = keyframe_at(table, row, "covariance_base");
  return frame;
}

void add_times_and_errors(const std::filesystem::path& folder, std::vector<RunFrame>& frames) {
  std::map<std::pair<bool, long long>, RunFrame*> by_time;
  for (RunFrame& frame : frames) by_time[{frame.stereo, microseconds(frame.time)}] = &frame;
  const auto find = [&](bool stereo, double time) -> RunFrame* {
    const auto found = by_time.find({stereo, microseconds(time)});
    return found == by_time.end() ? nullptr : found->second;
  };
  if (std::filesystem::exists(folder / "timing.csv")) {
    const ResultTable times(folder / "timing.csv");
    for (std::size_t i = 0; i < times.size(); ++i) {
      RunFrame* const frame = find(true, times.number(i, "time"));
      if (frame == nullptr) continue;
      frame->cpu_ms = times.number(i, "cpu_ms");
      frame->behind_ms = times.number(i, "behind_ms");
    }
  }
  if (std::filesystem::exists(folder / "errors.csv")) {
    const ResultTable errors(folder / "errors.csv");
    for (std::size_t i = 0; i < errors.size(); ++i) {
      RunFrame* const frame = find(errors.text(i, "camera") != "fisheye", errors.number(i, "time"));
      if (frame != nullptr) frame->error = errors.number(i, "error_m");
    }
  }
}

// What most of a loss' frames had.
std::string cause_of(const std::vector<const RunFrame*>& lost) {
  std::map<std::string, std::size_t> counts;
  double features = 0, inliers = 0;
  for (const RunFrame* frame : lost) {
    std::string_view rest = frame->causes;
    while (!rest.empty()) {
      const std::string_view cause = rest.substr(0, rest.find(';'));
      ++counts[std::string(cause.substr(0, cause.find('=')))];
      rest.remove_prefix(std::min(rest.size(), cause.size() + 1));
    }
    features += std::isfinite(frame->features) ? frame->features : 0;
    inliers += std::isfinite(frame->inliers) ? frame->inliers : 0;
  }
  std::string text;
  for (const auto& [cause, count] : counts) {
    if (2 * count < lost.size()) continue;
    text += (text.empty() ? "" : ", ") + cause;
  }
  if (!text.empty()) return text;
  const auto frames = static_cast<double>(lost.size());
  return fmt::format("no cause in the images: {:.0f} features, {:.0f} found in the map, on average",
                     features / frames, inliers / frames);
}

std::vector<LostStretch> find_losses(const std::vector<RunFrame>& frames, bool stereo) {
  std::vector<LostStretch> losses;
  std::vector<const RunFrame*> lost;
  std::optional<std::size_t> before;
  const auto end = [&] {
    if (!lost.empty()) losses.back().cause = cause_of(lost);
    lost.clear();
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool tracked_or_lost = std::isfinite(frames[i].features);  // else it was left out
    if (frames[i].stereo != stereo || !tracked_or_lost) continue;
    if (frames[i].world_from_cam) {
      end();
      before = i;
      continue;
    }
    if (lost.empty()) losses.push_back({i, i, 0, before, {}});
    losses.back().last = i;
    ++losses.back().frames;
    lost.push_back(&frames[i]);
  }
  end();
  return losses;
}

void find_times(RunStory& story) {
  std::vector<double> times, steps;
  for (const RunFrame& frame : story.frames) {
    if (frame.stereo) times.push_back(frame.time);
  }
  std::sort(times.begin(), times.end());
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  story.span = times.empty() ? 0 : times.back() - times.front();
  story.period = quantile(steps, 0.5);
}

}  // namespace

void complete_story(RunStory& story) {
  story.losses = find_losses(story.frames, true);
  const std::vector<LostStretch> fisheye = find_losses(story.frames, false);
  story.losses.insert(story.losses.end(), fisheye.begin(), fisheye.end());
  find_times(story);
}

RunStory read_story(const std::filesystem::path& folder, const MapSnapshot* map) {
  RunStory story;
  if (!std::filesystem::exists(folder / "frames.csv")) return story;
  const ResultTable table(folder / "frames.csv");
  for (std::size_t i = 0; i < table.size(); ++i) {
    RunFrame frame = frame_at(table, i, map);
    if (std::isfinite(frame.time)) story.frames.push_back(std::move(frame));
  }
  add_times_and_errors(folder, story.frames);
  complete_story(story);
  return story;
}

}  // namespace hybrid_slam
