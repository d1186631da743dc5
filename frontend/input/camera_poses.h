#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

// The true poses of both cameras, world_from_cam, ascending in time.
struct CameraPoses {
  std::vector<StampedPose> stereo;  // left camera
  std::vector<StampedPose> fisheye;
  std::string convention;  // as the file was read: "world_from_cam", "cam_from_world"
  std::vector<std::string> warnings;
};

// UWslam's camera_poses.txt: 15 columns, index, position and quaternion (w x y z) of the fisheye
// and of the left camera; or 8 columns, without the latter (UWHandles), which are world_from_cam
// unless the convention says otherwise; `times` [s] by index. Throws InputError naming file and
// line.
CameraPoses read_camera_poses(const std::filesystem::path& path, const std::vector<double>& times,
                              TruthConvention convention);

}  // namespace hybrid_slam
