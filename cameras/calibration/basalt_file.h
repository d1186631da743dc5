#pragma once

#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/files/input_error.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// A camera of Basalt's calibration.
struct BasaltCamera {
  Camera camera;                   // KannalaBrandt of kb4, ds and eucm; else Pinhole
  std::vector<double> distortion;  // of a Pinhole: none, or k1, k2, p1, p2, k3 ... k6 (OpenCV's)
  Rigid3d imu_from_camera;
  std::string note;  // how ds or eucm was taken; else empty
};

// All cameras of Basalt's JSON (cereal's: value0 with T_imu_cam, intrinsics and resolution), in
// order: camera_type kb4, ds, eucm, pinhole or pinhole-radtan8. Throws InputError with file, line
// and key; other types are refused by name.
std::vector<BasaltCamera> read_basalt_cameras(const std::string& path);

}  // namespace hybrid_slam
