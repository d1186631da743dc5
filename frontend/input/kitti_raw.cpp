#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "frontend/input/file_sequence.h"
#include "frontend/input/kitti_calibration.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

// KITTI raw, synchronised and rectified:
// <date>/<drive>_sync/{image_00,image_01}/{data/<number>.png, timestamps.txt}, oxts/ and, in
// <date>/, calib_cam_to_cam.txt, calib_velo_to_cam.txt and calib_imu_to_velo.txt. KITTI-360's
// perspective images: data_2d_raw/<drive>_sync/{image_00, image_01}/{data_rect/, timestamps.txt},
// calibration/perspective.txt, data_poses/<drive>_sync/cam0_to_world.txt. Row n of timestamps.txt
// belongs to the images of number n. Where there is no image_00, image_02 and image_03 are taken.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

using ImageFolders = std::array<const char*, 2>;
constexpr ImageFolders kFirstPair{"image_00", "image_01"};
constexpr ImageFolders kSecondPair{"image_02", "image_03"};

// The folder of a camera's images; empty if there is none.
fs::path images_of(const fs::path& folder, const char* camera) {
  for (const char* const data : {"data", "data_rect"}) {
    if (fs::is_directory(folder / camera / data)) return folder / camera / data;
  }
  return {};
}

bool is_raw_sequence(const fs::path& folder) {
  return !images_of(folder, kFirstPair[0]).empty() || !images_of(folder, kSecondPair[0]).empty();
}

// The numbers of the line that begins with `label`.
std::vector<double> numbers_of(const fs::path& path, const std::string& label, std::size_t count) {
  for (const TextLine& line : read_lines(path)) {
    if (!line.text.starts_with(label)) continue;
    std::vector<double> values;
    for (const std::string_view field :
         split_fields(std::string_view(line.text).substr(label.size()), ' ')) {
      values.push_back(parse_number(field, path, line.number));
    }
    if (values.size() != count) {
      throw line_error(path, line.number,
                       label + " expected " + std::to_string(count) + " numbers");
    }
    return values;
  }
  throw InputError(path.string() + ": no line \"" + label + "\"");
}

struct RawCalibration {
  Calibrated<RectifiedStereo> stereo;
  Eigen::Vector3d left_in_cam0 = Eigen::Vector3d::Zero();  // [m], in the rectified axes
};

RawCalibration read_raw_calibration(const fs::path& path, const ImageFolders& cameras,
                                    ImageSize size) {
  const auto matrix = [&](const char* camera) {
    return numbers_of(path, "P_rect_" + std::string(camera).substr(6) + ":", 12);
  };
  const std::vector<double> left = matrix(cameras[0]), right = matrix(cameras[1]);
  constexpr double kMaxRelative = 1e-6;
  for (const std::size_t i : {0, 2, 5, 6}) {
    if (!(std::abs(left[i] - right[i]) <= kMaxRelative * std::abs(left[i]))) {
      throw InputError(path.string() + ": the two P_rect are not those of a rectified pair");
    }
  }
  RawCalibration result;
  result.stereo = make_stereo_camera(left[0], left[5], left[2], left[6],
                                     (left[3] - right[3]) / left[0], size, path.string());
  const double depth = left[11];  // P = K (I | t), t = left_from_cam0
  result.left_in_cam0 = -Eigen::Vector3d((left[3] - left[2] * depth) / left[0],
                                         (left[7] - left[6] * depth) / left[5], depth);
  return result;
}

// A whole number of a time stamp, `text` without it.
int take_number(std::string_view& text, char end, const fs::path& path, int line) {
  int value = 0;
  const auto [at, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const auto size = static_cast<std::size_t>(at - text.data());
  if (error != std::errc() || size >= text.size() || text[size] != end) {
    throw line_error(path, line, "expected a time such as 2011-09-26 13:02:25.964389445");
  }
  text.remove_prefix(size + 1);
  return value;
}

// A transform of KITTI raw's calibration: lines R: and T:.
Rigid3d read_transform_lines(const fs::path& path) {
  const std::vector<double> r = numbers_of(path, "R:", 9), t = numbers_of(path, "T:", 3);
  return kitti_pose({0, {r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2]}},
                    path);
}

// Position and attitude of the IMU as its makers convert them (KITTI raw's devkit): Mercator at the
// first frame's latitude, east, north, up.
Rigid3d imu_pose(const std::vector<double>& v, double scale) {
  constexpr double kEarthRadius = 6378137;  // [m]
  constexpr double kDegree = std::numbers::pi / 180;
  const Eigen::Quaterniond rotation = Eigen::AngleAxisd(v[5], Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(v[4], Eigen::Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(v[3], Eigen::Vector3d::UnitX());
  const double north = std::log(std::tan((90 + v[0]) * kDegree / 2));
  return {rotation, Eigen::Vector3d(scale * kEarthRadius * v[1] * kDegree,
                                    scale * kEarthRadius * north, v[2])};
}

// Truth of the left camera from oxts/data/<number>.txt, relative to the first frame's position.
void read_oxts(const fs::path& folder, const fs::path& calibration, const NumberedFrames& frames,
               const Rigid3d& cam0_from_left, SequenceInfo& info) {
  const std::vector<double> rect =
      numbers_of(calibration / "calib_cam_to_cam.txt", "R_rect_00:", 9);
  const Eigen::Matrix3d rectified_from_cam0 =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rect.data());
  const Rigid3d cam0_from_imu =
      Rigid3d(Eigen::Quaterniond(rectified_from_cam0).normalized(), Eigen::Vector3d::Zero()) *
      read_transform_lines(calibration / "calib_velo_to_cam.txt") *
      read_transform_lines(calibration / "calib_imu_to_velo.txt");
  const Rigid3d imu_from_left = inverse(cam0_from_imu) * cam0_from_left;
  std::optional<double> scale;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < frames.times.size(); ++i) {
    char name[32];
    std::snprintf(name, sizeof(name), "%010d.txt", frames.first + static_cast<int>(i));
    const fs::path path = folder / "oxts" / "data" / name;
    if (!fs::exists(path)) continue;
    const std::vector<NumberRow> rows = read_number_rows(path, ' ');
    if (rows.size() != 1 || rows[0].values.size() < 6) {
      throw InputError(path.string() + ": expected one line of at least 6 numbers");
    }
    if (!scale) scale = std::cos(rows[0].values[0] * std::numbers::pi / 180);
    Rigid3d pose = imu_pose(rows[0].values, *scale);
    if (info.truth.empty()) origin = pose.translation();
    pose.translation() -= origin;
    info.truth.push_back({frames.times[i], pose * imu_from_left});
  }
}

// KITTI-360's cam0_to_world.txt: number, then 4x4.
void read_cam0_to_world(const fs::path& path, const NumberedFrames& frames,
                        const Rigid3d& cam0_from_left, SequenceInfo& info) {
  for (const NumberRow& row : read_number_rows(path, ' ')) {
    if (row.values.size() != 17) {
      throw line_error(path, row.line,
                       "expected 17 numbers, found " + std::to_string(row.values.size()));
    }
    const double index = row.values[0] - frames.first;
    if (!(index >= 0 && index < static_cast<double>(frames.times.size()))) continue;
    const NumberRow pose{row.line, {row.values.begin() + 1, row.values.begin() + 13}};
    const double time = frames.times[static_cast<std::size_t>(index)];
    if (!info.truth.empty() && !(time > info.truth.back().time)) {
      throw line_error(path, row.line, "numbers are not strictly ascending");
    }
    info.truth.push_back({time, kitti_pose(pose, path) * cam0_from_left});
  }
}

void read_raw_truth(const fs::path& folder, const NumberedFrames& frames,
                    const Eigen::Vector3d& left_in_cam0, SequenceInfo& info) {
  const Rigid3d cam0_from_left(Eigen::Quaterniond::Identity(), left_in_cam0);
  const fs::path above = fs::absolute(folder / "..").lexically_normal();
  const fs::path poses = above / ".." / "data_poses" / info.name / "cam0_to_world.txt";
  if (fs::exists(poses)) {
    read_cam0_to_world(poses.lexically_normal(), frames, cam0_from_left, info);
  } else if (fs::is_directory(folder / "oxts" / "data") &&
             fs::exists(above / "calib_imu_to_velo.txt")) {
    read_oxts(folder, above, frames, cam0_from_left, info);
  }
  info.truth_has_rotation = !info.truth.empty();
}

fs::path raw_calibration_file(const fs::path& folder) {
  const fs::path above = fs::absolute(folder / "..").lexically_normal();
  const fs::path perspective =
      (above / ".." / "calibration" / "perspective.txt").lexically_normal();
  return fs::exists(perspective) ? perspective : above / "calib_cam_to_cam.txt";
}

}  // namespace

std::vector<double> read_kitti_timestamps(const fs::path& path) {
  std::vector<double> times;
  for (const TextLine& line : read_lines(path)) {
    std::string_view text = line.text;
    const int year = take_number(text, '-', path, line.number);
    const int month = take_number(text, '-', path, line.number);
    const int day = take_number(text, ' ', path, line.number);
    const int hour = take_number(text, ':', path, line.number);
    const int minute = take_number(text, ':', path, line.number);
    const double second = parse_number(text, path, line.number);
    const std::chrono::year_month_day date{std::chrono::year(year),
                                           std::chrono::month(static_cast<unsigned>(month)),
                                           std::chrono::day(static_cast<unsigned>(day))};
    if (!date.ok()) throw line_error(path, line.number, "no such day");
    const auto days = std::chrono::sys_days(date).time_since_epoch().count();
    const double time = 86400.0 * static_cast<double>(days) + 3600 * hour + 60 * minute + second;
    if (!times.empty() && !(time > times.back())) {
      throw line_error(path, line.number, "times are not strictly ascending");
    }
    times.push_back(time);
  }
  if (times.empty()) throw InputError(path.string() + ": holds no times");
  return times;
}

Calibrated<RectifiedStereo> read_kitti_raw_stereo(const fs::path& path, bool color,
                                                  ImageSize size) {
  return read_raw_calibration(path, color ? kSecondPair : kFirstPair, size).stereo;
}

std::unique_ptr<ImageSequence> open_kitti_raw(const fs::path& path, const std::string& name,
                                              const InputOptions& options) {
  SequenceInfo info;
  const auto folder =
      choose_sequence(path, {path, path / "data_2d_raw"}, name, is_raw_sequence, info.warnings);
  if (!folder) return nullptr;
  info.name = folder_name(*folder);
  info.layout = "kitti";
  const ImageFolders& cameras =
      images_of(*folder, kFirstPair[0]).empty() ? kSecondPair : kFirstPair;
  std::array<NumberedImages, 2> images;
  for (std::size_t side = 0; side < 2; ++side) {
    const fs::path place = images_of(*folder, cameras[side]);
    images[side] = list_numbered_images(place.empty() ? *folder / cameras[side] : place, "");
    if (images[side].empty()) {
      throw InputError((*folder / cameras[side]).string() + ": holds no images");
    }
  }
  const fs::path times_path = *folder / cameras[0] / "timestamps.txt";
  NumberedFrames frames = match_frames(read_kitti_timestamps(times_path), times_path, images[0],
                                       images[1], info.warnings);
  const RawCalibration calibration =
      read_raw_calibration(raw_calibration_file(*folder), cameras, first_image_size(frames.files));
  info.stereo = calibration.stereo;
  read_raw_truth(*folder, frames, calibration.left_in_cam0, info);
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files), options, nullptr);
}

}  // namespace hybrid_slam
