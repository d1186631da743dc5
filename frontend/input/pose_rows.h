#pragma once

#include <filesystem>

#include "cameras/geometry/rigid3d.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

// Rotation of a quaternion read from a file. Throws InputError unless its length is near one.
Eigen::Quaterniond checked_rotation(double w, double x, double y, double z,
                                    const std::filesystem::path& path, int line);

// The pose of a KITTI line: 12 numbers, 3x4 row-major. Throws InputError if they are not 12 or the
// 3x3 part is no rotation.
Rigid3d kitti_pose(const NumberRow& row, const std::filesystem::path& path);

}  // namespace hybrid_slam
