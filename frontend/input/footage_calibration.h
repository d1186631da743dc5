#pragma once

#include <string>
#include <vector>

#include "frontend/input/pair_calibration.h"

namespace hybrid_slam {

// Reads the pair's calibration from the first file or, where each camera has one, from the first
// two or three, left and right first; told by their content:
//   one file    KITTI's calib.txt, calib_cam_to_cam.txt and perspective.txt (rectified); a Kalibr
//               camchain (raw); Basalt's JSON (raw); ORB-SLAM's settings: Camera1 and Camera2 (raw,
//               or rectified if Camera.type is), Camera.fx and Camera.bf (rectified; with LEFT.K
//               ... both); stella_vslam's with focal_x_baseline (likewise, with a StereoRectifier)
//   two files   EuRoC's sensor.yaml (raw); ROS camera_calibration or CameraInfo (both)
//   three       DSO's cameras and the matrix right_from_left (rectified, if that is what they say)
// `color`: of KITTI's pairs the colour one. `image`: the size of the left images. Throws InputError
// if there is no such file, or the two do not go together.
PairCalibration read_pair_calibration(const std::vector<std::string>& files, bool color,
                                      ImageSize image);

}  // namespace hybrid_slam
