#include "frontend/input/camera_poses.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "frontend/input/median.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr double kClearEvidence = 2;  // ratio of implausibilities that decides
constexpr std::size_t kBothColumns = 15;
constexpr std::size_t kFisheyeColumns = 8;

// The poses of both cameras as camera_poses.txt has them, whatever they mean.
struct FilePoses {
  int index = 0;
  Rigid3d fish, stereo;
};

// Without the stereo pair's, `has_stereo` is false.
std::vector<FilePoses> read_pose_pairs(const fs::path& path, std::size_t frame_count,
                                       bool& has_stereo) {
  std::vector<FilePoses> poses;
  for (const NumberRow& row : read_number_rows(path, ' ')) {
    const std::vector<double>& v = row.values;
    const bool as_first = poses.empty() || has_stereo == (v.size() == kBothColumns);
    if (!as_first || (v.size() != kBothColumns && v.size() != kFisheyeColumns)) {
      throw line_error(path, row.line, "expected 15 numbers, found " + std::to_string(v.size()));
    }
    has_stereo = v.size() == kBothColumns;
    if (!(v[0] >= 0 && v[0] < static_cast<double>(frame_count) && v[0] == std::floor(v[0]))) {
      throw line_error(path, row.line, "no time belongs to this index");
    }
    FilePoses pair;
    pair.index = static_cast<int>(v[0]);
    if (!poses.empty() && pair.index <= poses.back().index) {
      throw line_error(path, row.line, "indices are not strictly ascending");
    }
    pair.fish = Rigid3d(checked_rotation(v[4], v[5], v[6], v[7], path, row.line),
                        Eigen::Vector3d(v[1], v[2], v[3]));
    if (has_stereo) {
      pair.stereo = Rigid3d(checked_rotation(v[11], v[12], v[13], v[14], path, row.line),
                            Eigen::Vector3d(v[8], v[9], v[10]));
    }
    poses.push_back(pair);
  }
  return poses;
}

// How little the poses look like those of two cameras on one vehicle: the distance between the two
// [m], times the angle by which their optical axes miss the point that all axes miss least [rad];
// medians. A pose read the wrong way round scatters the axes, and puts the camera's rotation, times
// its distance from the world's origin, into its position.
double implausibility(const std::vector<FilePoses>& poses, bool invert) {
  std::vector<double> distances, angles;
  std::vector<Rigid3d> cameras;
  for (const FilePoses& pair : poses) {
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
bool is_cam_from_world(const std::vector<FilePoses>& poses, const fs::path& path,
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

}  // namespace

CameraPoses read_camera_poses(const fs::path& path, const std::vector<double>& times,
                              TruthConvention convention) {
  bool has_stereo = true;
  const std::vector<FilePoses> poses = read_pose_pairs(path, times.size(), has_stereo);
  CameraPoses result;
  bool invert = convention == TruthConvention::kCamFromWorld;
  if (!has_stereo) {
    result.warnings.push_back(path.string() +
                              ": has 8 columns: poses of the fisheye alone, read as " +
                              (invert ? "cam_from_world" : "world_from_cam"));
  } else if (convention == TruthConvention::kAuto) {
    invert = is_cam_from_world(poses, path, result.warnings);
  }
  result.convention = invert ? "cam_from_world" : "world_from_cam";
  for (const FilePoses& pair : poses) {
    const double time = times[static_cast<std::size_t>(pair.index)];
    if (has_stereo) result.stereo.push_back({time, invert ? inverse(pair.stereo) : pair.stereo});
    result.fisheye.push_back({time, invert ? inverse(pair.fish) : pair.fish});
  }
  return result;
}

}  // namespace hybrid_slam
