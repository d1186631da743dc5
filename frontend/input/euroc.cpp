#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "frontend/input/euroc_cameras.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/median.h"
#include "frontend/input/text_file.h"
#include "frontend/input/trajectory_file.h"

// EuRoC: mav0/cam{0,1}/{data.csv, data/, sensor.yaml}, raw images, rectified when read; truth in
// mav0/state_groundtruth_estimate0/data.csv.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr double kMaxTruthGap = 0.1;  // [s] to interpolate the truth across
constexpr double kNanosecond = 1e-9;  // [s]

struct StampedFile {
  std::int64_t stamp = 0;  // [ns]
  fs::path path;           // empty if the file is missing
};

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

std::string milliseconds(double nanoseconds) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", 1e-6 * nanoseconds);
  return text;
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

struct EurocFrames {
  std::vector<double> times;
  std::vector<FramePaths> files;
};

// The usual time between two images [ns].
double period_of(const std::vector<StampedFile>& files) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < files.size(); ++i) {
    steps.push_back(static_cast<double>(files[i].stamp - files[i - 1].stamp));
  }
  return steps.empty() ? 1e9 : median(std::move(steps));
}

// By how much each left image's nearest right one is later [ns]. `right` is not empty.
std::vector<double> nearest_differences(const std::vector<StampedFile>& left,
                                        const std::vector<StampedFile>& right) {
  std::vector<double> differences;
  std::size_t r = 0;
  for (const StampedFile& file : left) {
    while (r + 1 < right.size() &&
           std::abs(right[r + 1].stamp - file.stamp) <= std::abs(right[r].stamp - file.stamp)) {
      ++r;
    }
    differences.push_back(static_cast<double>(right[r].stamp - file.stamp));
  }
  return differences;
}

// How two cameras' clocks go together.
struct Pairing {
  std::int64_t offset = 0;     // [ns] that the right one's times are later
  std::int64_t tolerance = 0;  // [ns]
};

// An offset that all have in common is one of the clocks', or of the triggers', and is taken out.
Pairing find_pairing(const std::vector<double>& differences, double period,
                     const InputOptions& options, const fs::path& folder,
                     std::vector<std::string>& warnings) {
  constexpr double kMost = 1e7;         // [ns]
  constexpr double kShare = 0.1;        // of the period
  constexpr double kSynchronous = 5e5;  // [ns]: below, cameras count as triggered together
  Pairing pairing;
  const double least = std::min(kShare * period, kMost);
  pairing.tolerance =
      static_cast<std::int64_t>(options.pair_tolerance > 0 ? options.pair_tolerance * 1e9 : least);
  std::vector<double> near;
  for (const double d : differences) {
    if (std::abs(d) < 0.5 * period) near.push_back(d);
  }
  if (near.empty()) return pairing;
  const double offset = median(near);
  const auto agreeing = std::count_if(
      near.begin(), near.end(), [&](double d) { return std::abs(d - offset) <= kSynchronous; });
  const bool is_constant = 10 * agreeing >= 9 * static_cast<std::ptrdiff_t>(near.size());
  if (std::abs(offset) <= kSynchronous || !is_constant) return pairing;
  pairing.offset = static_cast<std::int64_t>(offset);
  warnings.push_back(folder.string() + ": cam1's times are " + milliseconds(offset) +
                     " ms later than cam0's throughout; that offset is taken out");
  return pairing;
}

// Pairs what was taken at the same time; images without a partner are left out.
EurocFrames match_stamps(const std::vector<StampedFile>& left,
                         const std::vector<StampedFile>& right, const fs::path& folder,
                         const InputOptions& options, std::vector<std::string>& warnings) {
  const std::vector<double> differences = nearest_differences(left, right);
  const double period = std::min(period_of(left), period_of(right));
  const Pairing pairing = find_pairing(differences, period, options, folder, warnings);
  EurocFrames frames;
  for (std::size_t l = 0, r = 0; l < left.size() && r < right.size();) {
    const std::int64_t difference = right[r].stamp - pairing.offset - left[l].stamp;
    if (std::abs(difference) <= pairing.tolerance) {
      frames.times.push_back(static_cast<double>(left[l].stamp) * kNanosecond);
      frames.files.push_back({left[l++].path, right[r++].path, {}});
    } else {
      ++(difference > 0 ? l : r);
    }
  }
  if (frames.times.empty()) {
    const auto closer = [](double a, double b) { return std::abs(a) < std::abs(b); };
    const double least = *std::min_element(differences.begin(), differences.end(), closer);
    throw InputError(
        folder.string() + ": cam0 and cam1 have no timestamps in common: the least difference is " +
        milliseconds(least) + " ms, the tolerance " +
        milliseconds(static_cast<double>(pairing.tolerance)) + " ms (--pair-tolerance)");
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
  EurocFrames frames = match_stamps(read_file_list(mav / "cam0"), read_file_list(mav / "cam1"), mav,
                                    options, info.warnings);
  const std::array<EurocCamera, 2> cameras = read_euroc_cameras(*folder, mav);
  const auto& [left, right] = cameras;
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
