#include "apps/map_tool/trajectory_export.h"

#include <fmt/format.h>

#include <iterator>
#include <map>
#include <utility>

#include "apps/io/trajectory.h"
#include "apps/map_tool/image_names.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// By camera and dive.
using KeyframesOf = std::map<std::pair<CameraId, std::size_t>, std::vector<const Keyframe*>>;

std::string file_stem(const MapSnapshot& map, CameraId camera, std::size_t run) {
  const bool stereo = baseline(map.camera(camera)) > 0;
  int number = 1;
  for (std::uint32_t i = 0; i < camera.value; ++i) {
    number += (baseline(map.camera(CameraId(i))) > 0) == stereo ? 1 : 0;
  }
  std::string stem = stereo ? "stereo" : "fisheye";
  if (number > 1) stem += std::to_string(number);
  if (run > 0) stem += fmt::format("_run{}", run + 1);
  return stem;
}

std::string kitti_text(const std::vector<const Keyframe*>& keyframes) {
  std::string text;
  for (const Keyframe* const keyframe : keyframes) {
    const Rigid3d pose = inverse(keyframe->cam_from_world);
    const Eigen::Matrix3d rotation = pose.rotation().toRotationMatrix();
    for (int row = 0; row < 3; ++row) {
      text += fmt::format("{}{} {} {} {}", row == 0 ? "" : " ", rotation(row, 0), rotation(row, 1),
                          rotation(row, 2), pose.translation()[row]);
    }
    text += '\n';
  }
  return text;
}

std::string times_text(const std::vector<const Keyframe*>& keyframes) {
  std::string text;
  for (const Keyframe* const keyframe : keyframes) {
    text += fmt::format("{}\n", keyframe->observations->time);
  }
  return text;
}

std::string euroc_text(const std::vector<const Keyframe*>& keyframes) {
  std::string text =
      "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z "
      "[]\n";
  for (const Keyframe* const keyframe : keyframes) {
    const Rigid3d pose = inverse(keyframe->cam_from_world);
    text += std::to_string(nanoseconds_of(*keyframe));
    for (const int i : {4, 5, 6, 3, 0, 1, 2}) text += fmt::format(",{}", pose.params[i]);
    text += '\n';
  }
  return text;
}

void write_poses(const std::vector<const Keyframe*>& keyframes, ExportFormat format,
                 const fs::path& stem) {
  const auto named = [&](const char* end) { return fs::path(stem.string() + end); };
  if (format == ExportFormat::kKitti) {
    write_file(named(".txt"), kitti_text(keyframes));
    write_file(named("_times.txt"), times_text(keyframes));
  } else if (format == ExportFormat::kEuroc) {
    write_file(named(".csv"), euroc_text(keyframes));
  } else {
    Trajectory trajectory;
    for (const Keyframe* const keyframe : keyframes) {
      trajectory.push_back({keyframe->observations->time, inverse(keyframe->cam_from_world)});
    }
    write_tum(named(".tum"), trajectory);
  }
}

}  // namespace

void export_trajectories(const MapSnapshot& map, KeyframeId component, ExportFormat format,
                         const fs::path& folder) {
  KeyframesOf keyframes;
  for (const auto& [id, run] : runs_of(map)) {
    const Keyframe& keyframe = map.at(id);
    if (keyframe.component != component) continue;
    keyframes[{keyframe.observations->camera, run}].push_back(&keyframe);
  }
  for (const auto& [of, list] : keyframes) {
    write_poses(list, format, folder / file_stem(map, of.first, of.second));
  }
}

}  // namespace hybrid_slam
