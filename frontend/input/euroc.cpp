#include <algorithm>
#include <charconv>

#include "frontend/input/euroc_cameras.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/stamp_pairing.h"
#include "frontend/input/text_file.h"
#include "frontend/input/trajectory_file.h"

// EuRoC: mav0/cam{0,1}/{data.csv, data/, sensor.yaml}, raw images, rectified when read; truth in
// mav0/state_groundtruth_estimate0/data.csv.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr double kMaxTruthGap = 0.1;  // [s] to interpolate the truth across

fs::path mav_folder(const fs::path& folder) {
  return fs::is_directory(folder / "mav0") ? folder / "mav0" : folder;
}

bool is_euroc_sequence(const fs::path& folder) {
  return fs::is_directory(folder / "mav0" / "cam0") ||
         fs::exists(folder / "cam0" / "sensor.yaml") || fs::exists(folder / "cam0" / "data.csv");
}

bool is_number(std::string_view field) {
  return !field.empty() &&
         std::string_view("+-0123456789.").find(field[0]) != std::string_view::npos;
}

std::vector<StampedFile> read_file_list(const fs::path& camera_folder) {
  const fs::path path = camera_folder / "data.csv";
  std::vector<StampedFile> files;
  for (const TextLine& line : read_lines(path)) {
    const std::vector<std::string_view> fields = split_fields(line.text, ',');
    if (fields.size() < 2 || fields[1].empty()) {
      throw line_error(path, line.number, "expected \"timestamp,filename\"");
    }
    if (files.empty() && !is_number(fields[0])) continue;  // the columns' names
    StampedFile file;
    const char* const end = fields[0].data() + fields[0].size();
    const auto [parsed, error] = std::from_chars(fields[0].data(), end, file.stamp);
    if (error != std::errc() || parsed != end || file.stamp < 0) {
      throw line_error(path, line.number, "the timestamp is not a whole number of nanoseconds");
    }
    if (!files.empty() && file.stamp <= files.back().stamp) {
      throw line_error(path, line.number, "times are not strictly ascending");
    }
    const fs::path image = camera_folder / "data" / fs::path(fields[1]);
    if (fs::exists(image)) file.path = image;
    files.push_back(std::move(file));
  }
  if (files.empty()) throw InputError(path.string() + ": lists no images");
  return files;
}

// Body poses: EuRoC's own truth or, as TUM-VI has it, that of a motion capture system.
std::optional<fs::path> truth_file(const fs::path& mav) {
  for (const char* const folder : {"state_groundtruth_estimate0", "mocap0", "gt0"}) {
    if (fs::exists(mav / folder / "data.csv")) return mav / folder / "data.csv";
  }
  return std::nullopt;
}

// The truth comes at its own, higher rate: interpolated to the frames' times.
std::vector<StampedPose> poses_at(const std::vector<double>& times,
                                  const std::vector<StampedPose>& poses,
                                  const Rigid3d& body_from_cam) {
  std::vector<StampedPose> result;
  for (const double time : times) {
    const auto after =
        std::lower_bound(poses.begin(), poses.end(), time,
                         [](const StampedPose& pose, double t) { return pose.time < t; });
    if (after == poses.end() || (after == poses.begin() && after->time > time)) continue;
    const auto before = after->time > time ? after - 1 : after;
    const double gap = after->time - before->time;
    if (gap > kMaxTruthGap) continue;
    const double part = gap > 0 ? (time - before->time) / gap : 0;
    const Rigid3d& a = before->world_from_cam;
    const Rigid3d& b = after->world_from_cam;
    const Rigid3d world_from_body(
        Eigen::Quaterniond(a.rotation()).slerp(part, Eigen::Quaterniond(b.rotation())),
        (1 - part) * a.translation() + part * b.translation());
    result.push_back({time, world_from_body * body_from_cam});
  }
  return result;
}

}  // namespace

std::unique_ptr<ImageSequence> open_euroc(const fs::path& path, const std::string& name,
                                          const InputOptions& options) {
  SequenceInfo info;
  const auto folder = choose_sequence(path, {path}, name, is_euroc_sequence, info.warnings);
  if (!folder) return nullptr;
  const fs::path mav = mav_folder(*folder);
  info.name = folder_name(folder_name(mav) == "mav0" ? mav / ".." : mav);
  info.layout = "euroc";
  StampedFrames frames =
      pair_by_stamps({"cam0", read_file_list(mav / "cam0")}, {"cam1", read_file_list(mav / "cam1")},
                     mav.string(), options, info.warnings);
  const std::array<EurocCamera, 2> cameras = read_euroc_cameras(*folder, mav);
  const auto& [left, right] = cameras;
  for (const EurocCamera& camera : cameras) {
    if (!camera.note.empty()) info.warnings.push_back(camera.source + ": " + camera.note);
  }
  check_image_size(first_image_size(frames.files), left.camera.size, left.source);
  auto rectifier = std::make_unique<const StereoRectifier>(
      left.camera, right.camera, inverse(right.body_from_cam) * left.body_from_cam, mav.string());
  if (!rectifier->note().empty()) info.warnings.push_back(rectifier->note());
  info.stereo =
      make_stereo_camera(rectifier->focal_length(), rectifier->focal_length(), rectifier->cx(),
                         rectifier->cy(), rectifier->baseline(), left.camera.size, mav.string());
  if (const auto truth = truth_file(mav)) {
    const TrajectoryFile poses = read_euroc_poses(*truth);
    info.warnings.insert(info.warnings.end(), poses.warnings.begin(), poses.warnings.end());
    info.truth = poses_at(frames.times, poses.poses,
                          left.body_from_cam * rectifier->raw_from_rectified_left());
    info.truth_has_rotation = !info.truth.empty();
  }
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files), options,
                                        std::move(rectifier));
}

}  // namespace hybrid_slam
