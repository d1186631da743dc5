#include <algorithm>
#include <charconv>
#include <cmath>

#include "cameras/files/yaml_section.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

// EuRoC: mav0/cam{0,1}/{data.csv, data/, sensor.yaml}, raw images, rectified when read; truth in
// mav0/state_groundtruth_estimate0/data.csv.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr std::int64_t kMaxStampDifference = 2'000'000;  // [ns] between left and right
constexpr double kMaxTruthGap = 0.1;                     // [s] to interpolate the truth across
constexpr double kNanosecond = 1e-9;                     // [s]

struct StampedFile {
  std::int64_t stamp = 0;  // [ns]
  fs::path path;           // empty if the file is missing
};

struct EurocCamera {
  RawCamera camera;
  Rigid3d body_from_cam;
};

fs::path mav_folder(const fs::path& folder) {
  return fs::is_directory(folder / "mav0") ? folder / "mav0" : folder;
}

bool is_euroc_sequence(const fs::path& folder) {
  return fs::is_directory(folder / "mav0" / "cam0") ||
         fs::exists(folder / "cam0" / "sensor.yaml") || fs::exists(folder / "cam0" / "data.csv");
}

std::vector<StampedFile> read_file_list(const fs::path& camera_folder) {
  const fs::path path = camera_folder / "data.csv";
  std::vector<StampedFile> files;
  for (const TextLine& line : read_lines(path)) {
    const std::vector<std::string_view> fields = split_fields(line.text, ',');
    if (fields.size() != 2 || fields[1].empty()) {
      throw line_error(path, line.number, "expected \"timestamp,filename\"");
    }
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

EurocCamera read_sensor(const fs::path& path) {
  const YamlSection file = YamlSection::read(path.string());
  if (file.text("camera_model") != "pinhole")
    file.fail("camera_model", "only pinhole is supported");
  const std::string model = file.text("distortion_model");
  if (model != "radial-tangential" && model != "radtan") {
    file.fail("distortion_model", "only radial-tangential is supported");
  }
  const std::vector<double> f_and_c = file.numbers("intrinsics", 4);
  const std::vector<double> distortion = file.numbers("distortion_coefficients", 4);
  const std::vector<double> size = file.numbers("resolution", 2);
  const std::vector<double> pose = file.child("T_BS").numbers("data", 16);

  EurocCamera result;
  RawCamera& camera = result.camera;
  for (const double side : size) {
    if (!(side >= 1 && side <= 65536)) file.fail("resolution", "impossible");
  }
  camera.size = {static_cast<int>(size[0]), static_cast<int>(size[1])};
  const auto checked = make_stereo_camera(f_and_c[0], f_and_c[1], f_and_c[2], f_and_c[3], 1,
                                          camera.size, path.string() + ": intrinsics");
  camera.fx = checked.params[0];
  camera.fy = checked.params[1];
  camera.cx = checked.params[2];
  camera.cy = checked.params[3];
  std::copy(distortion.begin(), distortion.end(), camera.distortion.begin());
  NumberRow row{file.line("T_BS"), {pose.begin(), pose.begin() + 12}};
  result.body_from_cam = kitti_pose(row, path);
  return result;
}

struct EurocFrames {
  std::vector<double> times;
  std::vector<FramePaths> files;
};

// Pairs what was taken at the same time; images without a partner are left out.
EurocFrames match_stamps(const std::vector<StampedFile>& left,
                         const std::vector<StampedFile>& right, const fs::path& folder,
                         std::vector<std::string>& warnings) {
  EurocFrames frames;
  for (std::size_t l = 0, r = 0; l < left.size() && r < right.size();) {
    const std::int64_t difference = right[r].stamp - left[l].stamp;
    if (std::abs(difference) <= kMaxStampDifference) {
      frames.times.push_back(static_cast<double>(left[l].stamp) * kNanosecond);
      frames.files.push_back({left[l++].path, right[r++].path, {}});
    } else {
      ++(difference > 0 ? l : r);
    }
  }
  if (frames.times.empty()) {
    throw InputError(folder.string() + ": cam0 and cam1 have no timestamps in common");
  }
  const std::size_t left_alone = left.size() - frames.times.size();
  const std::size_t right_alone = right.size() - frames.times.size();
  if (left_alone + right_alone > 0) {
    warnings.push_back(folder.string() + ": " + std::to_string(left_alone) + " of cam0's and " +
                       std::to_string(right_alone) +
                       " of cam1's timestamps have no partner; those images are left out");
  }
  check_completeness(frames.files, folder.string(), warnings);
  return frames;
}

// Body poses of a truth file.
std::vector<StampedPose> read_body_poses(const fs::path& path) {
  std::vector<StampedPose> poses;
  for (const NumberRow& row : read_number_rows(path, ',')) {
    const std::vector<double>& v = row.values;
    if (v.size() < 8) throw line_error(path, row.line, "expected at least 8 columns");
    const double time = v[0] * kNanosecond;
    if (!poses.empty() && !(time > poses.back().time)) {
      throw line_error(path, row.line, "times are not strictly ascending");
    }
    const Eigen::Quaterniond rotation = checked_rotation(v[4], v[5], v[6], v[7], path, row.line);
    poses.push_back({time, Rigid3d(rotation, Eigen::Vector3d(v[1], v[2], v[3]))});
  }
  return poses;
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

std::unique_ptr<ImageSequence> open_euroc(const fs::path& path, const std::string& name) {
  SequenceInfo info;
  const auto folder = choose_sequence(path, {path}, name, is_euroc_sequence, info.warnings);
  if (!folder) return nullptr;
  const fs::path mav = mav_folder(*folder);
  info.name = folder_name(folder_name(mav) == "mav0" ? mav / ".." : mav);
  info.layout = "euroc";
  EurocFrames frames =
      match_stamps(read_file_list(mav / "cam0"), read_file_list(mav / "cam1"), mav, info.warnings);
  const fs::path left_file = mav / "cam0" / "sensor.yaml";
  const EurocCamera left = read_sensor(left_file);
  const EurocCamera right = read_sensor(mav / "cam1" / "sensor.yaml");
  check_image_size(first_image_size(frames.files), left.camera.size, left_file.string());
  auto rectifier = std::make_unique<const StereoRectifier>(
      left.camera, right.camera, inverse(right.body_from_cam) * left.body_from_cam, mav.string());
  info.stereo =
      make_stereo_camera(rectifier->focal_length(), rectifier->focal_length(), rectifier->cx(),
                         rectifier->cy(), rectifier->baseline(), left.camera.size, mav.string());
  const fs::path truth = mav / "state_groundtruth_estimate0" / "data.csv";
  if (fs::exists(truth)) {
    info.truth = poses_at(frames.times, read_body_poses(truth),
                          left.body_from_cam * rectifier->raw_from_rectified_left());
    info.truth_has_rotation = !info.truth.empty();
  }
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files),
                                        std::move(rectifier));
}

}  // namespace hybrid_slam
