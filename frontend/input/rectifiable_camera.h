#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "cameras/files/yaml_section.h"
#include "frontend/input/pair_calibration.h"

namespace hybrid_slam {

// A raw camera as programs that rectify describe it: with the rotation into the
// axes of the rectified pair that it belongs to.
struct RectifiableCamera {
  RawCamera raw;
  Eigen::Matrix3d rectified_from_raw = Eigen::Matrix3d::Identity();
};

// The numbers that a file has under three keys.
struct CameraMatrices {
  std::string k_key, d_key, r_key;
  std::vector<double> k, d,
      r;  // 3x3 intrinsics; distortion, none is zeros; 3x3 rotation
};

// `model`: of the distortion, as ROS names it. Throws InputError where the
// numbers cannot be.
RectifiableCamera make_rectifiable_camera(const YamlSection& file, CameraMatrices matrices,
                                          const std::string& model, ImageSize size);

// Sets pair.raw, given pair.rectified: in the rectified axes the right camera
// stands one baseline to the right. Leaves it alone if raw and rectified images
// of these cameras are the same.
void add_raw_pair(const RectifiableCamera& left, const RectifiableCamera& right,
                  PairCalibration& pair);

}  // namespace hybrid_slam
