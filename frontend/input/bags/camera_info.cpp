#include "frontend/input/bags/camera_info.h"

#include <algorithm>
#include <cmath>

namespace hybrid_slam {

namespace {

constexpr const char* kGiveFile = " (--calibration gives it from a file)";

bool is_fisheye_model(const std::string& model) {
  return model == "equidistant" || model == "fisheye" || model == "kannala_brandt";
}

void check_calibrated(const CameraInfoMessage& info, const std::string& source) {
  const auto is_finite = [](double value) { return std::isfinite(value); };
  if (!std::all_of(info.d.begin(), info.d.end(), is_finite) ||
      !std::all_of(info.k.begin(), info.k.end(), is_finite) ||
      !std::all_of(info.r.begin(), info.r.end(), is_finite) ||
      !std::all_of(info.p.begin(), info.p.end(), is_finite)) {
    throw InputError(source + ": CameraInfo: a value is not finite");
  }
  constexpr std::uint32_t kMaxSide = 1 << 16;
  if (info.k[0] == 0 || info.width == 0 || info.height == 0 || info.width > kMaxSide ||
      info.height > kMaxSide) {
    throw InputError(source + ": CameraInfo: the camera is not calibrated" + kGiveFile);
  }
  const bool has_region = info.roi_width != 0 && info.roi_height != 0 &&
                          (info.roi_width != info.width || info.roi_height != info.height);
  if (info.binning_x > 1 || info.binning_y > 1 || has_region) {
    throw InputError(source + ": CameraInfo: binning and regions of interest are not supported" +
                     kGiveFile);
  }
}

ImageSize size_of(const CameraInfoMessage& info) {
  return {static_cast<int>(info.width), static_cast<int>(info.height)};
}

RawCamera raw_camera(const CameraInfoMessage& info, const std::string& source) {
  check_calibrated(info, source);
  const auto checked = make_stereo_camera(info.k[0], info.k[4], info.k[2], info.k[5], 1,
                                          size_of(info), source + ": CameraInfo: K");
  RawCamera camera;
  camera.fx = checked.params[0], camera.fy = checked.params[1];
  camera.cx = checked.params[2], camera.cy = checked.params[3];
  camera.size = size_of(info);
  camera.is_fisheye = is_fisheye_model(info.distortion_model);
  camera.distortion = info.d;
  if (camera.distortion.empty()) camera.distortion.assign(4, 0.0);
  const std::size_t count = camera.distortion.size();
  const std::string& model = info.distortion_model;
  const bool is_radial = model.empty() || model == "plumb_bob" || model == "rational_polynomial";
  if (!camera.is_fisheye && !is_radial) {
    throw InputError(source + ": CameraInfo: distortion_model \"" + model +
                     "\" is not supported (plumb_bob, rational_polynomial and equidistant are)");
  }
  if (camera.is_fisheye ? count != 4 : count != 4 && count != 5 && count != 8) {
    throw InputError(source + ": CameraInfo: D must have " +
                     (camera.is_fisheye ? "4" : "4, 5 or 8") + " numbers");
  }
  return camera;
}

// rectified_from_raw; the identity where it is all 0.
Eigen::Matrix3d rotation_of(const CameraInfoMessage& info, const std::string& source) {
  const Eigen::Matrix3d rotation =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(info.r.data());
  if (rotation.isZero(0)) return Eigen::Matrix3d::Identity();
  constexpr double kTolerance = 1e-4;  // of files that were written with few digits
  const Eigen::Matrix3d product = rotation * rotation.transpose();
  if (!product.isIdentity(kTolerance) || rotation.determinant() < 0) {
    throw InputError(source + ": CameraInfo: R is no rotation");
  }
  return rotation;
}

double baseline_of(const CameraInfoMessage& left, const CameraInfoMessage& right,
                   const std::string& source) {
  if (left.p[0] == 0 || right.p[0] == 0 || left.p[3] == right.p[3]) {
    throw InputError(source + ": CameraInfo: P has no baseline: not calibrated as a pair" +
                     kGiveFile);
  }
  return left.p[3] / left.p[0] - right.p[3] / right.p[0];
}

}  // namespace

bool is_rectified(const CameraInfoMessage& info) {
  const auto& k = info.k;
  const auto& p = info.p;
  const auto is_zero = [](double value) { return value == 0; };
  const bool no_distortion = std::all_of(info.d.begin(), info.d.end(), is_zero);
  constexpr std::array<double, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};
  const bool no_rotation =
      info.r == kIdentity || std::all_of(info.r.begin(), info.r.end(), is_zero);
  return no_distortion && no_rotation && !is_fisheye_model(info.distortion_model) && k[0] == p[0] &&
         k[2] == p[2] && k[4] == p[5] && k[5] == p[6];
}

Calibrated<RectifiedStereo> rectified_pair(const CameraInfoMessage& left,
                                           const CameraInfoMessage& right,
                                           const std::string& source) {
  check_calibrated(left, source);
  check_calibrated(right, source);
  constexpr double kTolerance = 1e-3;  // [px]
  for (const std::size_t i : {0, 2, 5, 6}) {
    if (!(std::abs(left.p[i] - right.p[i]) <= kTolerance)) {
      throw InputError(source +
                       ": CameraInfo: P of left and right are not those of a rectified pair");
    }
  }
  if (size_of(left) != size_of(right)) {
    throw InputError(source + ": CameraInfo: left and right differ in size");
  }
  baseline_of(left, right, source);
  const double baseline = (left.p[3] - right.p[3]) / left.p[0];
  return make_stereo_camera(left.p[0], left.p[5], left.p[2], left.p[6], baseline, size_of(left),
                            source + ": CameraInfo: P");
}

RawPair raw_pair(const CameraInfoMessage& left, const CameraInfoMessage& right,
                 const std::string& source) {
  RawPair pair{raw_camera(left, source), raw_camera(right, source), {}};
  const Eigen::Matrix3d left_rotation = rotation_of(left, source);
  const Eigen::Matrix3d right_from_rectified = rotation_of(right, source).transpose();
  const Eigen::Vector3d baseline(baseline_of(left, right, source), 0, 0);
  pair.right_from_left = Rigid3d(Eigen::Quaterniond(right_from_rectified * left_rotation),
                                 -(right_from_rectified * baseline));
  return pair;
}

Calibrated<KannalaBrandt> fisheye_camera(const CameraInfoMessage& info, const std::string& source) {
  const RawCamera raw = raw_camera(info, source);
  if (!raw.is_fisheye) {
    throw InputError(source + ": CameraInfo: distortion_model \"" + info.distortion_model +
                     "\" is no fisheye's (equidistant is)");
  }
  const std::vector<double>& k = raw.distortion;
  return {
      {raw.fx, raw.fy, raw.cx, raw.cy, k[0], k[1], k[2], k[3]}, raw.size.width, raw.size.height};
}

}  // namespace hybrid_slam
