#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/files/input_error.h"
#include "cameras/geometry/rigid3d.h"

// Readers of the calibration files in use. Each checks every value and throws InputError with one
// line, file:line: key: reason. OpenCV's "%YAML:1.0" header and "!!opencv-matrix" are understood
// everywhere.

namespace hybrid_slam {

// A rectified pair from two ROS camera_calibration files: image_width, image_height and
// projection_matrix (3x4; the right one's P[3] is -fx * baseline); or from two CameraInfo messages
// as "ros2 topic echo" prints them. Refused: sizes or focal lengths
// that differ, a baseline that is zero, vertical or of the wrong sign (files swapped).
Calibrated<RectifiedStereo> read_ros_stereo(const std::string& left_path,
                                            const std::string& right_path);

// One camera of a Kalibr camchain. Pinhole with equidistant distortion is KannalaBrandt; with
// radtan or none it is Pinhole; ds, eucm and omni are KannalaBrandt as close as that comes.
struct KalibrCamera {
  std::string name;  // "cam0", ...
  Camera camera;
  std::array<double, 4> radtan{};  // k1, k2, p1, p2: rectify images by these when loading
  std::optional<Rigid3d> camera_from_previous;  // T_cn_cnm1
  std::optional<Rigid3d> camera_from_imu;       // T_cam_imu
  std::string note;                             // how ds, eucm or omni was taken; else empty
};

// All cameras of the chain, in order. Other camera or distortion models are refused by name.
std::vector<KalibrCamera> read_kalibr_camchain(const std::string& path);

// A fisheye from any of: a section whose name has "fish" in it, written as Kalibr does; a camchain
// with one equidistant camera or else one ds, eucm or omni; Basalt's JSON with one such camera; fx,
// fy, cx, cy, k1 ... k4 (bare, as "Camera.fx" and "Camera1.fx", ORB-SLAM's, or within "Camera:",
// stella_vslam's); camera_matrix and distortion_coefficients (ROS, OpenCV); k and d (CameraInfo).
// Where a file says it twice, both must agree. Width and height are 0 if the file (not a camchain)
// does not name them. `warnings`: which of several was taken, a skew that is left out, how a lens
// of another model was taken.
Calibrated<KannalaBrandt> read_fisheye(const std::string& path,
                                       std::vector<std::string>* warnings = nullptr);

}  // namespace hybrid_slam
