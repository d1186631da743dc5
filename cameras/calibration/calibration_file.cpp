#include "cameras/calibration/calibration_file.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "cameras/files/yaml_section.h"

namespace hybrid_slam {
namespace {

constexpr int kMaxImageSize = 1 << 16;  // [px]

int image_size(const YamlSection& section, const std::string& key, double value) {
  if (!(value >= 1 && value <= kMaxImageSize) || value != std::floor(value)) {
    section.fail(key, "is no image size");
  }
  return static_cast<int>(value);
}

// k: fx, fy, cx, cy. Width and height of 0 are unknown.
void check_intrinsics(const YamlSection& section, const double* k, int width, int height,
                      const std::string& key) {
  if (!(k[0] > 0) || !(k[1] > 0)) section.fail(key, "the focal length must be positive");
  if (width > 0 && (k[2] < 0 || k[2] > width || k[3] < 0 || k[3] > height)) {
    section.fail(key, "the principal point lies outside the image");
  }
}

struct RectifiedCamera {
  int width;
  int height;
  std::vector<double> p;  // 3x4
};

RectifiedCamera read_ros_camera(const YamlSection& file) {
  RectifiedCamera camera;
  camera.width = image_size(file, "image_width", file.number("image_width"));
  camera.height = image_size(file, "image_height", file.number("image_height"));
  camera.p = file.matrix("projection_matrix", 3, 4);
  const std::vector<double>& p = camera.p;
  if (p[1] != 0 || p[4] != 0 || p[8] != 0 || p[9] != 0 || p[10] != 1 || p[11] != 0) {
    file.fail("projection_matrix", "is no rectified camera's");
  }
  const double intrinsics[4] = {p[0], p[5], p[2], p[6]};
  check_intrinsics(file, intrinsics, camera.width, camera.height, "projection_matrix");
  return camera;
}

KalibrCamera read_kalibr_camera(const YamlSection& chain, const std::string& name) {
  const YamlSection section = chain.child(name);
  KalibrCamera result;
  result.name = name;
  if (const std::string model = section.text("camera_model"); model != "pinhole") {
    section.fail("camera_model", "'" + model + "' is not supported (pinhole is)");
  }
  const std::vector<double> k = section.numbers("intrinsics", 4);
  const std::vector<double> resolution = section.numbers("resolution", 2);
  const int width = image_size(section, "resolution", resolution[0]);
  const int height = image_size(section, "resolution", resolution[1]);
  check_intrinsics(section, k.data(), width, height, "intrinsics");

  const std::string distortion = section.text("distortion_model");
  if (distortion == "equidistant") {
    const std::vector<double> d = section.numbers("distortion_coeffs", 4);
    result.camera =
        Calibrated<KannalaBrandt>{{k[0], k[1], k[2], k[3], d[0], d[1], d[2], d[3]}, width, height};
  } else if (distortion == "radtan" || distortion == "none") {
    result.camera = Calibrated<Pinhole>{{k[0], k[1], k[2], k[3]}, width, height};
    if (distortion == "radtan") {
      const std::vector<double> d = section.numbers("distortion_coeffs", 4);
      std::copy(d.begin(), d.end(), result.radtan.begin());
    }
  } else {
    section.fail("distortion_model",
                 "'" + distortion + "' is not supported (equidistant, radtan, none are)");
  }

  if (section.has("T_cn_cnm1")) {
    const auto rows = section.rows("T_cn_cnm1", 4, 4);
    Eigen::Matrix4d t;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) t(r, c) = rows[std::size_t(r)][std::size_t(c)];
    }
    const Eigen::Matrix3d rotation = t.topLeftCorner<3, 3>();
    constexpr double kTolerance = 1e-4;  // files are written with few digits
    if ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() > kTolerance ||
        rotation.determinant() < 0 || t.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      section.fail("T_cn_cnm1", "is no rigid transform");
    }
    result.camera_from_previous = Rigid3d(Eigen::Quaterniond(rotation), t.topRightCorner<3, 1>());
  }
  return result;
}

std::vector<KalibrCamera> read_kalibr_cameras(const YamlSection& chain) {
  std::vector<KalibrCamera> cameras;
  for (int i = 0; chain.has("cam" + std::to_string(i)); ++i) {
    cameras.push_back(read_kalibr_camera(chain, "cam" + std::to_string(i)));
  }
  if (cameras.empty()) chain.fail("cam0", "is missing");
  return cameras;
}

Calibrated<KannalaBrandt> only_fisheye(const YamlSection& chain) {
  std::optional<Calibrated<KannalaBrandt>> found;
  for (const KalibrCamera& kalibr : read_kalibr_cameras(chain)) {
    const auto* fisheye = std::get_if<Calibrated<KannalaBrandt>>(&kalibr.camera);
    if (fisheye == nullptr) continue;
    if (found) chain.fail(kalibr.name, "is a second fisheye, and one is expected");
    found = *fisheye;
  }
  if (!found) chain.fail("cam0", "no camera of this chain is a fisheye (pinhole, equidistant)");
  return *found;
}

using FisheyeParams = std::array<double, KannalaBrandt::kParamCount>;

FisheyeParams read_named_params(const YamlSection& file, const std::string& prefix) {
  FisheyeParams params;
  const char* const names[] = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
  for (std::size_t i = 0; i < params.size(); ++i) params[i] = file.number(prefix + names[i]);
  return params;
}

FisheyeParams read_matrix_params(const YamlSection& file) {
  const std::vector<double> k = file.matrix("camera_matrix", 3, 3);
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    file.fail("camera_matrix", "must be (fx 0 cx; 0 fy cy; 0 0 1)");
  }
  const YamlSection d_matrix = file.child("distortion_coefficients");
  if (d_matrix.number("rows") * d_matrix.number("cols") != 4) {
    file.fail("distortion_coefficients", "a fisheye has 4 of them");
  }
  const std::vector<double> d = d_matrix.numbers("data", 4);
  return {k[0], k[4], k[2], k[5], d[0], d[1], d[2], d[3]};
}

}  // namespace

Calibrated<RectifiedStereo> read_ros_stereo(const std::string& left_path,
                                            const std::string& right_path) {
  const YamlSection left_file = YamlSection::read(left_path);
  const YamlSection right_file = YamlSection::read(right_path);
  const RectifiedCamera left = read_ros_camera(left_file);
  const RectifiedCamera right = read_ros_camera(right_file);
  if (left.width != right.width || left.height != right.height) {
    right_file.fail("image_width", "the size differs from that of " + left_path);
  }
  constexpr double kTolerance = 1e-3;  // [px]
  for (const std::size_t i : std::array<std::size_t, 4>{0, 2, 5, 6}) {
    if (std::abs(left.p[i] - right.p[i]) > kTolerance) {
      right_file.fail("projection_matrix", "the pair is not rectified: entry " + std::to_string(i) +
                                               " differs from that of " + left_path);
    }
  }
  if (left.p[7] != 0 || right.p[7] != 0) {
    right_file.fail("projection_matrix", "a vertical baseline is not supported");
  }
  if (left.p[3] != 0) {
    left_file.fail("projection_matrix", left.p[3] < 0 && right.p[3] == 0
                                            ? "left and right files are swapped"
                                            : "P[3] of the left camera must be 0");
  }
  if (right.p[3] == 0) right_file.fail("projection_matrix", "P[3] is 0: there is no baseline");
  if (right.p[3] > 0) {
    right_file.fail("projection_matrix",
                    "P[3] is positive: the baseline has the wrong sign (left and right swapped?)");
  }
  return {{left.p[0], left.p[5], left.p[2], left.p[6], -right.p[3] / right.p[0]},
          left.width,
          left.height};
}

std::vector<KalibrCamera> read_kalibr_camchain(const std::string& path) {
  return read_kalibr_cameras(YamlSection::read(path));
}

Calibrated<KannalaBrandt> read_fisheye(const std::string& path) {
  const YamlSection file = YamlSection::read(path);
  if (file.has("cam0")) return only_fisheye(file);
  for (const char* key : {"distortion_model", "Camera.type"}) {
    if (!file.has(key)) continue;
    const std::string model = file.text(key);
    if (model != "equidistant" && model != "fisheye" && model != "KannalaBrandt8") {
      file.fail(key, "'" + model + "' is no fisheye (equidistant is)");
    }
  }

  std::vector<std::pair<std::string, FisheyeParams>> found;
  for (const std::string prefix : {"", "Camera."}) {
    if (file.has(prefix + "fx")) {
      found.emplace_back(prefix + "fx", read_named_params(file, prefix));
    }
  }
  if (file.has("camera_matrix")) {
    found.emplace_back("camera_matrix", read_matrix_params(file));
  }
  if (found.empty()) file.fail("fx", "neither it nor cam0 nor camera_matrix is there");
  for (const auto& [key, params] : found) {
    for (std::size_t i = 0; i < params.size(); ++i) {
      if (std::abs(params[i] - found[0].second[i]) > 1e-9 * (1 + std::abs(params[i]))) {
        file.fail(key, "contradicts " + found[0].first);
      }
    }
  }

  Calibrated<KannalaBrandt> camera{found[0].second, 0, 0};
  for (const char* prefix : {"image_", "Camera."}) {
    const std::string width = std::string(prefix) + "width";
    const std::string height = std::string(prefix) + "height";
    if (!file.has(width)) continue;
    camera.width = image_size(file, width, file.number(width));
    camera.height = image_size(file, height, file.number(height));
  }
  check_intrinsics(file, camera.params.data(), camera.width, camera.height, found[0].first);
  return camera;
}

}  // namespace hybrid_slam
