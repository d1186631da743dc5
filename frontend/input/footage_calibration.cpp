#include "frontend/input/footage_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "cameras/calibration/calibration_file.h"
#include "cameras/files/yaml_section.h"
#include "frontend/input/euroc_cameras.h"
#include "frontend/input/kitti_calibration.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr const char* kPairFormats =
    "a stereo pair (KITTI's calib.txt or calib_cam_to_cam.txt, a Kalibr camchain, Basalt's JSON, "
    "ORB-SLAM's settings with two cameras or Camera.bf; or two files, left and right: EuRoC's "
    "sensor.yaml, "
    "ROS camera_calibration, CameraInfo)";

bool has_line(const std::string& path, std::initializer_list<const char*> starts) {
  for (const TextLine& line : read_lines(path)) {
    for (const char* const start : starts) {
      if (line.text.starts_with(start)) return true;
    }
  }
  return false;
}

RawPair raw_pair(const EurocCamera& left, const EurocCamera& right) {
  return {left.camera, right.camera, inverse(right.body_from_cam) * left.body_from_cam};
}

ImageSize size_of(const YamlSection& file, const char* width, const char* height) {
  const double w = file.number(width), h = file.number(height);
  if (!(w >= 1 && w <= 65536)) file.fail(width, "impossible");
  if (!(h >= 1 && h <= 65536)) file.fail(height, "impossible");
  return {static_cast<int>(w), static_cast<int>(h)};
}

bool is_word(const std::string& word, std::initializer_list<const char*> words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

// A file that describes raw images, too.
bool has_ros_intrinsics(const YamlSection& file) {
  return file.has("camera_matrix") || file.has("K") || file.has("k");
}

bool is_ros_camera(const YamlSection& file) {
  return file.has("projection_matrix") || (file.has("width") && (file.has("P") || file.has("p")));
}

// A camera as ROS has it: intrinsics and distortion of the raw image, the rotation that rectifies.
struct RosCamera {
  RawCamera raw;
  Eigen::Matrix3d rectified_from_raw = Eigen::Matrix3d::Identity();
};

std::string key_of(const YamlSection& file, const char* upper, const char* lower) {
  return file.has(upper) ? upper : lower;
}

void set_distortion(const YamlSection& file, const std::string& key, std::vector<double> d,
                    RawCamera& camera) {
  const std::string model =
      file.has("distortion_model") ? file.text("distortion_model") : "plumb_bob";
  camera.is_fisheye = is_word(model, {"equidistant", "fisheye", "kannala_brandt"});
  if (!camera.is_fisheye &&
      !is_word(model, {"plumb_bob", "rational_polynomial", "rational", "none", ""})) {
    file.fail("distortion_model", "'" + model +
                                      "' is not supported (plumb_bob, rational_polynomial, "
                                      "equidistant are)");
  }
  if (d.empty()) d.assign(4, 0.0);
  const std::size_t count = d.size();
  if (camera.is_fisheye ? count != 4 : count != 4 && count != 5 && count != 8) {
    file.fail(key, camera.is_fisheye ? "must have 4 numbers" : "must have 4, 5 or 8 numbers");
  }
  camera.distortion = std::move(d);
}

RosCamera read_ros_camera(const YamlSection& file) {
  RosCamera camera;
  std::vector<double> k, r, d;
  std::string k_key = "camera_matrix", d_key = "distortion_coefficients";
  std::string r_key = "rectification_matrix";
  if (file.has("projection_matrix")) {
    k = file.matrix(k_key, 3, 3);
    const YamlSection matrix = file.child(d_key);
    d = matrix.numbers("data");
    r = file.matrix(r_key, 3, 3);
    camera.raw.size = size_of(file, "image_width", "image_height");
  } else {
    k_key = key_of(file, "K", "k"), d_key = key_of(file, "D", "d"), r_key = key_of(file, "R", "r");
    k = file.numbers(k_key, 9);
    d = file.numbers(d_key);
    r = file.numbers(r_key, 9);
    camera.raw.size = size_of(file, "width", "height");
  }
  if (k[1] != 0 || k[3] != 0 || !(k[0] > 0) || !(k[4] > 0)) file.fail(k_key, "is no camera's");
  camera.raw.fx = k[0], camera.raw.fy = k[4], camera.raw.cx = k[2], camera.raw.cy = k[5];
  set_distortion(file, d_key, std::move(d), camera.raw);
  camera.rectified_from_raw = RowMajor3d(r.data());
  constexpr double kTolerance = 1e-3;
  if (!((camera.rectified_from_raw * camera.rectified_from_raw.transpose() -
         Eigen::Matrix3d::Identity())
            .norm() < kTolerance)) {
    file.fail(r_key, "is no rotation");
  }
  return camera;
}

// Whether raw and rectified images of the camera are the same.
bool is_rectified_already(const RosCamera& camera, const Calibrated<RectifiedStereo>& rectified) {
  constexpr double kSame = 1e-6;
  const RawCamera& raw = camera.raw;
  const auto& [fx, fy, cx, cy, baseline] = rectified.params;
  const auto differ = [](double a, double b) { return !(std::abs(a - b) <= kSame * b); };
  return !raw.is_fisheye && camera.rectified_from_raw.isIdentity(kSame) &&
         std::all_of(raw.distortion.begin(), raw.distortion.end(),
                     [](double d) { return d == 0; }) &&
         !differ(raw.fx, fx) && !differ(raw.fy, fy) && !differ(raw.cx, cx) && !differ(raw.cy, cy);
}

// In the rectified axes the right camera stands one baseline to the right.
void read_ros_pair(const std::string& left_path, const std::string& right_path,
                   PairCalibration& result) {
  result.rectified = read_ros_stereo(left_path, right_path);
  const YamlSection left_file = YamlSection::read(left_path);
  const YamlSection right_file = YamlSection::read(right_path);
  if (!has_ros_intrinsics(left_file) || !has_ros_intrinsics(right_file)) return;
  const RosCamera left = read_ros_camera(left_file);
  const RosCamera right = read_ros_camera(right_file);
  if (is_rectified_already(left, *result.rectified) &&
      is_rectified_already(right, *result.rectified)) {
    return;
  }
  const Eigen::Matrix3d raw_from_rectified = right.rectified_from_raw.transpose();
  const Rigid3d right_from_left(
      Eigen::Quaterniond(raw_from_rectified * left.rectified_from_raw).normalized(),
      raw_from_rectified * Eigen::Vector3d(-result.rectified->params[4], 0, 0));
  result.raw = RawPair{left.raw, right.raw, right_from_left};
}

// A camera of ORB-SLAM's settings, "Camera1".
RawCamera read_orb_camera(const YamlSection& file, const std::string& name, bool is_fisheye,
                          ImageSize size) {
  RawCamera camera;
  const auto value = [&](const char* key) { return file.number(name + "." + key); };
  const auto value_or_0 = [&](const char* key) {
    return file.has(name + "." + key) ? value(key) : 0.0;
  };
  camera.fx = value("fx"), camera.fy = value("fy"), camera.cx = value("cx"),
  camera.cy = value("cy");
  if (!(camera.fx > 0 && camera.fy > 0))
    file.fail(name + ".fx", "the focal length is not positive");
  camera.is_fisheye = is_fisheye;
  camera.size = size;
  if (is_fisheye) {
    camera.distortion = {value("k1"), value("k2"), value("k3"), value("k4")};
  } else {
    camera.distortion = {value_or_0("k1"), value_or_0("k2"), value_or_0("p1"), value_or_0("p2"),
                         value_or_0("k3")};
  }
  return camera;
}

void read_orb_pair(const YamlSection& file, ImageSize image, PairCalibration& result) {
  const std::string type =
      file.has("Camera.type") ? file.text("Camera.type") : std::string("PinHole");
  const ImageSize size = file.has("Camera.width") && file.has("Camera.height")
                             ? size_of(file, "Camera.width", "Camera.height")
                             : image;
  if (!file.has("Camera2.fx")) {  // Camera.bf, or the rectified type of version 3
    const std::string prefix = file.has("Camera1.fx") ? "Camera1." : "Camera.";
    const double fx = file.number(prefix + "fx");
    const double baseline =
        file.has("Camera.bf") ? file.number("Camera.bf") / fx : file.number("Stereo.b");
    result.rectified =
        make_stereo_camera(fx, file.number(prefix + "fy"), file.number(prefix + "cx"),
                           file.number(prefix + "cy"), baseline, size, result.source);
    return;
  }
  if (!is_word(type, {"PinHole", "KannalaBrandt8"})) {
    file.fail("Camera.type", "'" + type + "' is not supported (PinHole, KannalaBrandt8 are)");
  }
  const bool is_fisheye = type == "KannalaBrandt8";
  std::vector<double> pose = file.matrix("Stereo.T_c1_c2", 4, 4);
  pose.resize(12);
  const Rigid3d left_from_right = kitti_pose({file.line("Stereo.T_c1_c2"), pose}, result.source);
  result.raw =
      RawPair{read_orb_camera(file, "Camera1", is_fisheye, size),
              read_orb_camera(file, "Camera2", is_fisheye, size), inverse(left_from_right)};
}

const std::string& second_file(const std::vector<std::string>& files) {
  if (files.size() < 2) {
    throw InputError(files[0] +
                     ": is the calibration of one camera; that of the right one must follow");
  }
  return files[1];
}

void read_yaml_pair(const std::vector<std::string>& files, ImageSize image,
                    PairCalibration& result) {
  const YamlSection file = YamlSection::read(files[0]);
  if (file.has_section("cam0") && file.has_section("cam1")) {
    const auto cameras = read_camchain_pair(files[0]);
    result.raw = raw_pair(cameras[0], cameras[1]);
  } else if (file.has_section("value0")) {
    const auto cameras = read_basalt_pair(files[0]);
    result.raw = raw_pair(cameras[0], cameras[1]);
  } else if (file.has("Camera2.fx") || file.has("Camera.bf") || file.has("Stereo.b")) {
    read_orb_pair(file, image, result);
  } else if (file.has("T_BS")) {
    result.raw = raw_pair(read_euroc_sensor(files[0]), read_euroc_sensor(second_file(files)));
    result.files_used = 2;
  } else if (is_ros_camera(file)) {
    read_ros_pair(files[0], second_file(files), result);
    result.files_used = 2;
  } else {
    throw InputError(files[0] + ": is not the calibration of " + kPairFormats);
  }
}

}  // namespace

PairCalibration read_pair_calibration(const std::vector<std::string>& files, bool color,
                                      ImageSize image) {
  if (files.empty()) throw InputError(std::string("no calibration: give that of ") + kPairFormats);
  PairCalibration result;
  result.source = files[0];
  result.files_used = 1;
  if (has_line(files[0], {"P0:", "P2:"})) {
    result.rectified = read_kitti_stereo(files[0], color, image);
  } else if (has_line(files[0], {"P_rect_00:", "P_rect_02:"})) {
    result.rectified = read_kitti_raw_stereo(files[0], color, image);
  } else {
    read_yaml_pair(files, image, result);
  }
  return result;
}

}  // namespace hybrid_slam
