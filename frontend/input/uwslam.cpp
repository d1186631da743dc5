#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "cameras/calibration_file.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

// UWslam: hybrid/<sequence>/images/raw/<number>_{left,right,fish}.<png|jpg> with camera_poses.txt
// and hybrid/calibration/; stereo/images/<number>_{0,1}.<png|jpg> with gt_poses.txt and
// stereo/calibration/. Stereo images are rectified; row n of times.txt (or time.txt) belongs to the
// images of number n.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr double kClearEvidence = 2;  // ratio of implausibilities that decides

bool is_uwslam_sequence(const fs::path& folder) {
  if (!fs::is_directory(folder / "images")) return false;
  if (fs::is_directory(folder / "images" / "raw")) return true;
  const auto has = [&](const char* file) { return fs::exists(folder / file); };
  return has("times.txt") || has("time.txt") || has("gt_poses.txt") || has("calibration");
}

std::optional<fs::path> choose_folder(const fs::path& path, const std::string& name,
                                      std::vector<std::string>& warnings) {
  return choose_sequence(path, {path, path / "hybrid"}, name, is_uwslam_sequence, warnings);
}

fs::path times_file(const fs::path& folder) {
  const fs::path singular = folder / "time.txt";
  return !fs::exists(folder / "times.txt") && fs::exists(singular) ? singular
                                                                   : folder / "times.txt";
}

struct ImageLists {
  NumberedImages left, right;
};

ImageLists list_images(const fs::path& folder) {
  const fs::path raw = folder / "images" / "raw";
  const fs::path images = fs::is_directory(raw) ? raw : folder / "images";
  ImageLists lists{list_numbered_images(images, "_left"), list_numbered_images(images, "_right")};
  std::string left_suffix = "_left", right_suffix = "_right";
  if (lists.left.empty() && lists.right.empty()) {
    lists = {list_numbered_images(images, "_0"), list_numbered_images(images, "_1")};
    if (!lists.left.empty() || !lists.right.empty()) left_suffix = "_0", right_suffix = "_1";
  }
  if (lists.left.empty() && lists.right.empty()) {
    throw InputError(images.string() + ": holds no images <number>_left or <number>_0");
  }
  for (const auto& [list, suffix] :
       {std::pair(&lists.left, left_suffix), std::pair(&lists.right, right_suffix)}) {
    if (list->empty()) throw InputError(images.string() + ": holds no images <number>" + suffix);
  }
  return lists;
}

Calibrated<RectifiedStereo> read_calibration(const fs::path& folder) {
  const fs::path own = folder / "calibration";
  const fs::path shared = fs::absolute(folder / ".." / "calibration").lexically_normal();
  const fs::path& place = fs::is_directory(own) ? own : shared;
  const auto camera = read_ros_stereo((place / "left_camera.yaml").string(),
                                      (place / "right_camera.yaml").string());
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  return make_stereo_camera(fx, fy, cx, cy, baseline, {camera.width, camera.height},
                            place.string());
}

// The poses of both cameras as camera_poses.txt has them, whatever they mean.
struct PosePair {
  int index = 0;
  Rigid3d fish, stereo;
};

std::vector<PosePair> read_pose_pairs(const fs::path& path, std::size_t frame_count) {
  std::vector<PosePair> poses;
  for (const NumberRow& row : read_number_rows(path, ' ')) {
    const std::vector<double>& v = row.values;
    if (v.size() != 15) {
      throw line_error(path, row.line, "expected 15 numbers, found " + std::to_string(v.size()));
    }
    if (!(v[0] >= 0 && v[0] < static_cast<double>(frame_count) && v[0] == std::floor(v[0]))) {
      throw line_error(path, row.line, "no time belongs to this index");
    }
    PosePair pair;
    pair.index = static_cast<int>(v[0]);
    if (!poses.empty() && pair.index <= poses.back().index) {
      throw line_error(path, row.line, "indices are not strictly ascending");
    }
    pair.fish = Rigid3d(checked_rotation(v[4], v[5], v[6], v[7], path, row.line),
                        Eigen::Vector3d(v[1], v[2], v[3]));
    pair.stereo = Rigid3d(checked_rotation(v[11], v[12], v[13], v[14], path, row.line),
                          Eigen::Vector3d(v[8], v[9], v[10]));
    poses.push_back(pair);
  }
  return poses;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// How little the poses look like those of two cameras on one vehicle: the distance between the two
// [m], times the angle by which their optical axes miss the point that all axes miss least [rad];
// medians. A pose read the wrong way round scatters the axes, and puts the camera's rotation, times
// its distance from the world's origin, into its position.
double implausibility(const std::vector<PosePair>& poses, bool invert) {
  std::vector<double> distances, angles;
  std::vector<Rigid3d> cameras;
  for (const PosePair& pair : poses) {
    cameras.push_back(invert ? inverse(pair.fish) : pair.fish);
    cameras.push_back(invert ? inverse(pair.stereo) : pair.stereo);
    const Eigen::Vector3d fish = cameras[cameras.size() - 2].translation();
    distances.push_back((fish - cameras.back().translation()).norm());
  }
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Rigid3d& world_from_cam : cameras) {
    const Eigen::Vector3d axis = world_from_cam.rotation() * Eigen::Vector3d::UnitZ();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    normal += across;
    sum += across * world_from_cam.translation();
  }
  const Eigen::Vector3d point_in_world = normal.ldlt().solve(sum);
  for (const Rigid3d& world_from_cam : cameras) {
    const Eigen::Vector3d point = inverse(world_from_cam) * point_in_world;
    angles.push_back(std::atan2(point.head<2>().norm(), point.z()));
  }
  return median(std::move(distances)) * median(std::move(angles));
}

// Whether the poses are cam_from_world. Without clear evidence (a world whose origin is a camera
// that hardly moves looks alike both ways) they are what the dataset's description says.
bool is_cam_from_world(const std::vector<PosePair>& poses, const fs::path& path,
                       std::vector<std::string>& warnings) {
  const double inverted = implausibility(poses, true);
  const double direct = implausibility(poses, false);
  if (!(kClearEvidence * std::min(inverted, direct) <= std::max(inverted, direct))) {
    warnings.push_back(path.string() +
                       ": the poses fit both conventions; took them as world_from_cam");
    return false;
  }
  return inverted < direct;
}

void read_camera_poses(const fs::path& path, const std::vector<double>& times,
                       TruthConvention convention, SequenceInfo& info) {
  const std::vector<PosePair> poses = read_pose_pairs(path, times.size());
  bool invert = convention == TruthConvention::kCamFromWorld;
  if (convention == TruthConvention::kAuto) invert = is_cam_from_world(poses, path, info.warnings);
  info.truth_convention = invert ? "cam_from_world" : "world_from_cam";
  for (const PosePair& pair : poses) {
    info.truth.push_back(
        {times[static_cast<std::size_t>(pair.index)], invert ? inverse(pair.stereo) : pair.stereo});
  }
  info.truth_has_rotation = !info.truth.empty();
}

// Positions only: "timestamp x y z", or "x y z" with row n belonging to index n.
void read_positions(const fs::path& path, const std::vector<double>& times, SequenceInfo& info) {
  const std::vector<NumberRow> rows = read_number_rows(path, ' ');
  if (rows.empty()) return;
  const std::size_t columns = rows.front().values.size();
  if (columns != 3 && columns != 4) {
    throw line_error(path, rows.front().line, "expected 3 or 4 numbers");
  }
  if (columns == 3 && rows.size() != times.size()) {
    info.warnings.push_back(path.string() + ": has " + std::to_string(rows.size()) +
                            " positions for " + std::to_string(times.size()) + " times");
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& v = rows[i].values;
    if (v.size() != columns) {
      throw line_error(path, rows[i].line, "expected " + std::to_string(columns) + " numbers");
    }
    if (columns == 3 && i == times.size()) break;
    const double time = columns == 4 ? v[0] : times[i];
    if (!info.truth.empty() && !(time > info.truth.back().time)) {
      throw line_error(path, rows[i].line, "times are not strictly ascending");
    }
    const Eigen::Vector3d position(v[columns - 3], v[columns - 2], v[columns - 1]);
    info.truth.push_back({time, Rigid3d(Eigen::Quaterniond::Identity(), position)});
  }
}

}  // namespace

std::unique_ptr<ImageSequence> open_uwslam(const fs::path& path, const std::string& name,
                                           TruthConvention convention) {
  SequenceInfo info;
  const auto folder = choose_folder(path, name, info.warnings);
  if (!folder) return nullptr;
  info.name = folder_name(*folder);
  info.layout = "uwslam";
  const ImageLists images = list_images(*folder);
  const fs::path times_path = times_file(*folder);
  const std::vector<double> times = read_times(times_path);
  NumberedFrames frames = match_frames(times, times_path, images.left, images.right, info.warnings);
  info.stereo = read_calibration(*folder);
  check_image_size(first_image_size(frames.files), {info.stereo.width, info.stereo.height},
                   folder->string() + ": calibration");
  if (fs::exists(*folder / "camera_poses.txt")) {
    read_camera_poses(*folder / "camera_poses.txt", times, convention, info);
  } else if (fs::exists(*folder / "gt_poses.txt")) {
    read_positions(*folder / "gt_poses.txt", times, info);
  }
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files), nullptr);
}

}  // namespace hybrid_slam
