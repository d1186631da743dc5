#include "frontend/input/footage_calibration.h"

#include <array>

#include "cameras/calibration/calibration_file.h"
#include "cameras/files/yaml_section.h"
#include "frontend/input/dso_calibration.h"
#include "frontend/input/euroc_cameras.h"
#include "frontend/input/kitti_calibration.h"
#include "frontend/input/rectifiable_camera.h"
#include "frontend/input/slam_settings.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

constexpr const char* kPairFormats =
    "a stereo pair (KITTI's calib.txt or calib_cam_to_cam.txt, a Kalibr camchain, Basalt's JSON, "
    "ORB-SLAM's settings with two cameras or Camera.bf, stella_vslam's with focal_x_baseline; or "
    "two files, left and right: EuRoC's "
    "sensor.yaml, ROS camera_calibration, CameraInfo; or three: DSO's cameras, left and right, and "
    "the matrix between them)";

bool has_line(const std::string& path, std::initializer_list<const char*> starts) {
  for (const TextLine& line : read_lines(path)) {
    for (const char* const start : starts) {
      if (line.text.starts_with(start)) return true;
    }
  }
  return false;
}

void take_euroc_pair(const std::array<EurocCamera, 2>& cameras, PairCalibration& result) {
  const auto& [left, right] = cameras;
  result.raw = {left.camera, right.camera, inverse(right.body_from_cam) * left.body_from_cam};
  for (const EurocCamera& camera : cameras) {
    if (!camera.note.empty()) result.notes.push_back(camera.source + ": " + camera.note);
  }
}

// A file that describes raw images, too.
bool has_ros_intrinsics(const YamlSection& file) {
  return file.has("camera_matrix") || file.has("K") || file.has("k");
}

bool is_ros_camera(const YamlSection& file) {
  return file.has("projection_matrix") || (file.has("width") && (file.has("P") || file.has("p")));
}

std::string key_of(const YamlSection& file, const char* upper, const char* lower) {
  return file.has(upper) ? upper : lower;
}

// A camera as ROS has it.
RectifiableCamera read_ros_camera(const YamlSection& file) {
  CameraMatrices matrices;
  ImageSize size;
  if (file.has("projection_matrix")) {
    matrices = {"camera_matrix", "distortion_coefficients", "rectification_matrix", {}, {}, {}};
    matrices.k = file.matrix(matrices.k_key, 3, 3);
    matrices.d = file.child(matrices.d_key).numbers("data");
    matrices.r = file.matrix(matrices.r_key, 3, 3);
    size = image_size_of(file, "image_width", "image_height");
  } else {
    matrices = {key_of(file, "K", "k"), key_of(file, "D", "d"), key_of(file, "R", "r"), {}, {}, {}};
    matrices.k = file.numbers(matrices.k_key, 9);
    matrices.d = file.numbers(matrices.d_key);
    matrices.r = file.numbers(matrices.r_key, 9);
    size = image_size_of(file, "width", "height");
  }
  const std::string model =
      file.has("distortion_model") ? file.text("distortion_model") : "plumb_bob";
  return make_rectifiable_camera(file, std::move(matrices), model, size);
}

void read_ros_pair(const std::string& left_path, const std::string& right_path,
                   PairCalibration& result) {
  result.rectified = read_ros_stereo(left_path, right_path);
  const YamlSection left = YamlSection::read(left_path), right = YamlSection::read(right_path);
  if (!has_ros_intrinsics(left) || !has_ros_intrinsics(right)) return;
  add_raw_pair(read_ros_camera(left), read_ros_camera(right), result);
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
    take_euroc_pair(read_camchain_pair(files[0]), result);
  } else if (file.has_section("value0")) {
    take_euroc_pair(read_basalt_pair(files[0]), result);
  } else if (is_orb_pair(file)) {
    read_orb_pair(file, image, result);
  } else if (is_stella_pair(file)) {
    read_stella_pair(file, result);
  } else if (file.has("T_BS")) {
    take_euroc_pair({read_euroc_sensor(files[0]), read_euroc_sensor(second_file(files))}, result);
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
  } else if (is_dso_camera(files[0])) {
    if (files.size() < 3) {
      throw InputError(files[0] + ": is one camera; that of the right one and the 4x4 matrix " +
                       "right_from_left must follow");
    }
    result = read_dso_pair(files[0], files[1], files[2]);
  } else {
    read_yaml_pair(files, image, result);
  }
  return result;
}

}  // namespace hybrid_slam
