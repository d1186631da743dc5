#pragma once

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include <Eigen/Geometry>

#include "apps/io/trajectory.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {

// A winding path of `count` poses, 0.1 s apart.
inline Trajectory winding_path(int count) {
  Trajectory path;
  for (int i = 0; i < count; ++i) {
    const double t = 0.1 * i;
    const Eigen::Quaterniond rotation =
        Eigen::AngleAxisd(0.3 * t, Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(0.2 * std::sin(t), Eigen::Vector3d::UnitX());
    const Eigen::Vector3d position(3 * std::sin(0.4 * t), 0.3 * std::cos(t), 1.5 * t);
    path.push_back({t, Rigid3d(rotation, position)});
  }
  return path;
}

inline void write_kitti(const std::filesystem::path& path, const Trajectory& trajectory) {
  std::string text;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Matrix3d r = pose.world_from_cam.rotation().toRotationMatrix();
    const Eigen::Vector3d t = pose.world_from_cam.translation();
    char line[400];
    std::snprintf(line, sizeof(line),
                  "%.12f %.12f %.12f %.12f %.12f %.12f %.12f %.12f %.12f %.12f "
                  "%.12f %.12f\n",
                  r(0, 0), r(0, 1), r(0, 2), t.x(), r(1, 0), r(1, 1), r(1, 2), t.y(), r(2, 0),
                  r(2, 1), r(2, 2), t.z());
    text += line;
  }
  write_text(path, text);
}

}  // namespace hybrid_slam
