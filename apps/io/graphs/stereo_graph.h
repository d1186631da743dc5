#pragma once

#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// A rectified stereo bundle problem in three text files, as GTSAM's examples have it:
//   <a>calibration[<b>].txt    fx fy s cx cy baseline; the skew s must be 0
//   <a>camera_poses<b>.txt     id and 4x4 world_from_cam, row by row
//   <a>stereo_factors<b>.txt   pose landmark u_left u_right v X Y Z, the point in the camera's
//   frame
// `path` is the folder, if it holds one such problem, or the file of the factors. A landmark starts
// where its first factor puts it. The first pose is fixed, the calibration is known, sigma 1 px.
GraphFile read_stereo_graph(const std::filesystem::path& path);

// Whether the name of a file is that of such factors.
bool is_stereo_factors(const std::filesystem::path& path);

}  // namespace hybrid_slam
