#pragma once

#include <filesystem>
#include <string>

#include "frontend/input/pair_calibration.h"

namespace hybrid_slam {

// Cameras as DSO and what came of it (4Seasons, TUM-VI's dso folder) write them: a file for each,
//
//   Pinhole|RadTan|EquiDistant|KannalaBrandt fx fy cx cy <distortion>
//   width height
//
// what follows is for DSO's own undistortion. The four numbers are in pixels, or fractions of the
// image's width and height, counted from its corner.

// Whether the file begins with the name of a camera model of DSO's.
bool is_dso_camera(const std::filesystem::path& path);

// Two cameras, and a file of the 4x4 matrix right_from_left. Of a pair that agrees in rows and has
// no distortion the images are rectified, of others raw. Throws InputError.
PairCalibration read_dso_pair(const std::filesystem::path& left, const std::filesystem::path& right,
                              const std::filesystem::path& right_from_left);

}  // namespace hybrid_slam
