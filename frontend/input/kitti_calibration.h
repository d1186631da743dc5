#pragma once

#include <filesystem>
#include <vector>

#include "frontend/input/file_sequence.h"

// What files of KITTI say when they come without its folders. `color`: of the pair of colour
// cameras (2 and 3), not the grey ones (0 and 1); `size`: of the images. All throw InputError.
namespace hybrid_slam {

// calib.txt of the odometry dataset.
Calibrated<RectifiedStereo> read_kitti_stereo(const std::filesystem::path& path, bool color,
                                              ImageSize size);

// calib_cam_to_cam.txt of the raw data, perspective.txt of KITTI-360.
Calibrated<RectifiedStereo> read_kitti_raw_stereo(const std::filesystem::path& path, bool color,
                                                  ImageSize size);

// timestamps.txt of the raw data: lines such as "2011-09-26 13:02:25.964389445", as seconds since
// 1970.
std::vector<double> read_kitti_timestamps(const std::filesystem::path& path);

}  // namespace hybrid_slam
