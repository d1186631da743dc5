#include <fmt/format.h>

#include "apps/io/trajectory.h"
#include "cameras/files/output_file.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace {

constexpr std::size_t kTumColumns = 8;
constexpr std::size_t kKittiColumns = 12;

StampedPose tum_pose(const NumberRow& row, const std::filesystem::path& path) {
  const std::vector<double>& v = row.values;
  return {v[0], Rigid3d(checked_rotation(v[7], v[4], v[5], v[6], path, row.line),
                        Eigen::Vector3d(v[1], v[2], v[3]))};
}

}  // namespace

std::string tum_line(const StampedPose& pose) {
  const auto& t = pose.world_from_cam.translation();
  Eigen::Vector4d q = pose.world_from_cam.rotation().coeffs();
  if (q.w() < 0) q = -q;
  if (!q.allFinite() || !t.allFinite()) {
    throw std::logic_error("a pose of the trajectory is not finite");
  }
  return fmt::format("{:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}", pose.time, t.x(),
                     t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

void write_tum(const std::filesystem::path& path, std::span<const StampedPose> trajectory) {
  std::string text;
  for (const StampedPose& pose : trajectory) text += tum_line(pose) + '\n';
  write_file(path, text);
}

TrajectoryFile read_trajectory(const std::filesystem::path& path) {
  const std::vector<NumberRow> rows = read_number_rows(path, ' ');
  if (rows.empty()) throw InputError(path.string() + ": holds no poses");
  const std::size_t columns = rows.front().values.size();
  if (columns != kTumColumns && columns != kKittiColumns) {
    throw line_error(path, rows.front().line,
                     "expected 8 columns (TUM) or 12 (KITTI), found " + std::to_string(columns));
  }
  TrajectoryFile file;
  file.has_times = columns == kTumColumns;
  for (const NumberRow& row : rows) {
    if (row.values.size() != columns) {
      throw line_error(path, row.line,
                       "expected " + std::to_string(columns) + " columns, found " +
                           std::to_string(row.values.size()));
    }
    StampedPose pose =
        file.has_times ? tum_pose(row, path)
                       : StampedPose{static_cast<double>(file.poses.size()), kitti_pose(row, path)};
    if (!file.poses.empty() && !(pose.time > file.poses.back().time)) {
      throw line_error(path, row.line, "times are not strictly ascending");
    }
    file.poses.push_back(std::move(pose));
  }
  return file;
}

}  // namespace hybrid_slam
