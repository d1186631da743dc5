#include <algorithm>
#include <cmath>
#include <map>

#include "frontend/input/dso_calibration.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/footage_calibration.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/stamp_pairing.h"
#include "frontend/input/text_file.h"

// 4Seasons: {undistorted_images,distorted_images}/cam{0,1}/<frame>.png, times.txt; calibration/ in
// the recording's folder or beside it; truth of the keyframes in GNSSPoses.txt.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr const char* kUndistorted = "undistorted_images";
constexpr const char* kDistorted = "distorted_images";

bool is_recording(const fs::path& folder) {
  return fs::is_directory(folder / kUndistorted / "cam0") ||
         fs::is_directory(folder / kDistorted / "cam0");
}

// When each frame was taken [ns]: by its name.
using FrameTimes = std::map<std::string, std::int64_t, std::less<>>;

// "frame seconds exposure". Without the file frames are named by their time in nanoseconds.
FrameTimes read_frame_times(const fs::path& path) {
  FrameTimes times;
  if (!fs::exists(path)) return times;
  constexpr double kMostSeconds = 9.2e9;  // in nanoseconds they fit into 64 bits
  for (const TextLine& line : read_lines(path)) {
    const std::vector<std::string_view> fields = split_fields(line.text, ' ');
    if (fields.size() < 2) throw line_error(path, line.number, "expected \"frame seconds\"");
    double time = parse_number(fields[1], path, line.number);
    if (std::abs(time) >= kLeastNanoseconds) time *= 1e-9;
    if (!(std::abs(time) <= kMostSeconds)) {
      throw line_error(path, line.number, "is a time of more than 292 years");
    }
    const auto stamp = static_cast<std::int64_t>(std::llround(time * 1e9));
    if (!times.emplace(fields[0], stamp).second) {
      throw line_error(path, line.number, "frame " + quote(fields[0]) + " has a time already");
    }
  }
  return times;
}

std::optional<std::int64_t> time_of(const std::string& frame, const FrameTimes& times) {
  if (!times.empty()) {
    const auto found = times.find(frame);
    return found == times.end() ? std::nullopt : std::optional(found->second);
  }
  constexpr std::size_t kDigits = 19;  // of nanoseconds since 1970
  if (frame.size() != kDigits || frame.find_first_not_of("0123456789") != std::string::npos ||
      frame[0] > '8') {
    return std::nullopt;
  }
  return std::stoll(frame);
}

std::vector<StampedFile> list_images(const fs::path& folder, const FrameTimes& times,
                                     std::vector<std::string>& warnings) {
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": no such folder");
  std::vector<StampedFile> files;
  std::size_t without_time = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (!has_image_extension(entry.path())) continue;
    const auto stamp = time_of(entry.path().stem().string(), times);
    if (stamp) {
      files.push_back({*stamp, entry.path()});
    } else {
      ++without_time;
    }
  }
  if (files.empty()) {
    throw InputError(folder.string() + ": holds no images " +
                     (times.empty() ? "named by nanoseconds, and there is no times.txt"
                                    : "that times.txt names"));
  }
  if (without_time > 0) {
    warnings.push_back(folder.string() + ": " + std::to_string(without_time) +
                       " images without a time are left out");
  }
  std::sort(files.begin(), files.end(),
            [](const StampedFile& a, const StampedFile& b) { return a.stamp < b.stamp; });
  const auto twice = std::adjacent_find(
      files.begin(), files.end(),
      [](const StampedFile& a, const StampedFile& b) { return a.stamp == b.stamp; });
  if (twice != files.end()) {
    throw InputError(folder.string() + ": " + twice->path.filename().string() + " and " +
                     (twice + 1)->path.filename().string() + " have the same time");
  }
  return files;
}

fs::path calibration_folder(const fs::path& recording) {
  const fs::path beside = fs::absolute(recording).lexically_normal() / "..";
  for (const fs::path& parent : {recording, beside.lexically_normal()}) {
    for (const char* const name : {"calibration", "Calibration"}) {
      if (fs::is_directory(parent / name)) return parent / name;
    }
  }
  throw InputError(recording.string() + ": there is no folder calibration in it or beside it");
}

PairCalibration read_calibration(const fs::path& folder, bool undistorted, ImageSize image) {
  const std::string prefix = undistorted ? "undistorted_" : "";
  const fs::path chain = folder / "camchain.yaml";
  if (!undistorted && fs::exists(chain)) {
    return read_pair_calibration({chain.string()}, false, image);
  }
  return read_dso_pair(folder / (prefix + "calib_0.txt"), folder / (prefix + "calib_1.txt"),
                       folder / (prefix + "calib_stereo.txt"));
}

// "frame,tx,ty,tz,qx,qy,qz,qw,scale,...": world_from_cam, to be scaled into metres.
void read_truth(const fs::path& path, const FrameTimes& times, SequenceInfo& info) {
  if (!fs::exists(path)) return;
  for (const TextLine& line : read_lines(path)) {
    const std::vector<std::string_view> fields = split_fields(line.text, ' ');
    if (fields.size() < 9) {
      throw line_error(path, line.number, "expected a frame, position, quaternion and scale");
    }
    const auto stamp = time_of(std::string(fields[0]), times);
    if (!stamp) continue;
    std::array<double, 8> v{};
    for (std::size_t i = 0; i < v.size(); ++i) {
      v[i] = parse_number(fields[i + 1], path, line.number);
    }
    const double time = static_cast<double>(*stamp) * 1e-9;
    if (!info.truth.empty() && time <= info.truth.back().time) {
      throw line_error(path, line.number, "times are not strictly ascending");
    }
    info.truth.push_back({time, Rigid3d(checked_rotation(v[6], v[3], v[4], v[5], path, line.number),
                                        v[7] * Eigen::Vector3d(v[0], v[1], v[2]))});
  }
}

}  // namespace

std::unique_ptr<ImageSequence> open_four_seasons(const fs::path& path, const std::string& name,
                                                 const InputOptions& options) {
  SequenceInfo info;
  const auto folder = choose_sequence(path, {path}, name, is_recording, info.warnings);
  if (!folder) return nullptr;
  info.name = folder_name(*folder);
  info.layout = "4seasons";
  const bool undistorted = fs::is_directory(*folder / kUndistorted / "cam0");
  const fs::path images = *folder / (undistorted ? kUndistorted : kDistorted);
  const FrameTimes times = read_frame_times(*folder / "times.txt");
  const StampedCamera left{"cam0", list_images(images / "cam0", times, info.warnings)};
  const StampedCamera right{"cam1", list_images(images / "cam1", times, info.warnings)};
  StampedFrames frames = pair_by_stamps(left, right, images.string(), options, info.warnings);
  const ImageSize size = first_image_size(frames.files);
  const PairCalibration pair = read_calibration(calibration_folder(*folder), undistorted, size);
  std::unique_ptr<const StereoRectifier> rectifier;
  if (pair.raw) {
    rectifier = take_raw_pair(pair, info);
  } else {
    take_rectified_pair(pair, info);
  }
  check_image_size(size, {info.stereo.width, info.stereo.height}, pair.source);
  read_truth(*folder / "GNSSPoses.txt", times, info);
  info.truth_has_rotation = !info.truth.empty();
  if (rectifier) {  // to the truth's camera, which is the dataset's own rectified one, by position
    info.truth_has_rotation = false;
    for (StampedPose& pose : info.truth) {
      pose.world_from_cam =
          Rigid3d(Eigen::Quaterniond::Identity(), pose.world_from_cam.translation());
    }
  }
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files), options,
                                        std::move(rectifier));
}

}  // namespace hybrid_slam
