#include "cameras/calibration/calibration_file.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// A folder of files that goes away with the test.
class Folder {
 public:
  Folder() {
    path_ = std::filesystem::temp_directory_path() / "hybrid_slam_calibration_XXXXXX";
    std::string name = path_.string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~Folder() { std::filesystem::remove_all(path_); }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name) << text;
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
};

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("the test's text lacks " + from);
  return text.replace(at, from.size(), to);
}

// The whole message, without the folder; "" if nothing is thrown.
template <typename F>
std::string error_of(const F& f) {
  try {
    f();
    return "";
  } catch (const InputError& e) {
    const std::string message = e.what();
    CHECK(message.find('\n') == std::string::npos);
    return message.substr(message.find_last_of('/', message.find(": ")) + 1);
  }
}

const std::string kLeft = R"(image_width: 1024
image_height: 768
camera_name: left_camera
camera_matrix: {rows: 3, cols: 3, data: [870, 0, 500, 0, 870, 390, 0, 0, 1]}
distortion_model: plumb_bob
projection_matrix:
  rows: 3
  cols: 4
  data: [868.4, 0, 506.3, 0, 0, 868.5, 391.7, 0, 0, 0, 1, 0]
)";
const std::string kRight = replaced(kLeft, "506.3, 0,", "506.3, -130.26,");

std::string stereo_error(const std::string& left, const std::string& right) {
  const Folder folder;
  const std::string left_path = folder.write("left.yaml", left);
  const std::string right_path = folder.write("right.yaml", right);
  return error_of([&] { read_ros_stereo(left_path, right_path); });
}

const std::string kChain = R"(cam0:
  camera_model: pinhole
  intrinsics: [460.0, 461.0, 365.0, 246.0]
  distortion_model: radtan
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [0.0, -1.0, 0.0, 0.1]
  - [1.0, 0.0, 0.0, 0.2]
  - [0.0, 0.0, 1.0, 0.3]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  intrinsics: [302.7, 302.4, 514.9, 508.3]
  distortion_model: equidistant
  distortion_coeffs: [-0.0184, 0.0117, -0.0093, 0.0021]
  resolution: [1024, 1023]
)";

std::string chain_error(const std::string& chain) {
  const Folder folder;
  const std::string path = folder.write("chain.yaml", chain);
  return error_of([&] { read_kalibr_camchain(path); });
}

const std::string kOpenCv = R"(%YAML:1.0
---
image_width: 1024
image_height: 1023
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 302.7, 0., 514.9, 0., 302.4,
       508.3, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ -0.0184, 0.0117, -0.0093, 0.0021 ]
)";
const std::string kPlain =
    "fx: 302.7\nfy: 302.4\ncx: 514.9\ncy: 508.3\n"
    "k1: -0.0184\nk2: 0.0117\nk3: -0.0093\nk4: 0.0021\n";
const std::array<double, 8> kFisheye = {302.7,   302.4,  514.9,   508.3,
                                        -0.0184, 0.0117, -0.0093, 0.0021};

std::string fisheye_error(const std::string& text) {
  const Folder folder;
  const std::string path = folder.write("fish.yaml", text);
  return error_of([&] { read_fisheye(path); });
}

}  // namespace

TEST_CASE("ROS stereo files: values") {
  const Folder folder;
  const auto stereo =
      read_ros_stereo(folder.write("left.yaml", kLeft), folder.write("right.yaml", kRight));
  CHECK(stereo.params[0] == 868.4);
  CHECK(stereo.params[1] == 868.5);
  CHECK(stereo.params[2] == 506.3);
  CHECK(stereo.params[3] == 391.7);
  CHECK(stereo.params[4] == Approx(0.15));
  CHECK(stereo.width == 1024);
  CHECK(stereo.height == 768);
}

TEST_CASE("ROS stereo files: each fault has its line") {
  CHECK(stereo_error(kRight, kLeft) ==
        "left.yaml:7: projection_matrix: left and right files are swapped");
  CHECK(stereo_error(kLeft, kLeft) ==
        "right.yaml:7: projection_matrix: P[3] is 0: there is no baseline");
  CHECK(stereo_error(kLeft, replaced(kRight, "-130.26", "130.26")) ==
        "right.yaml:7: projection_matrix: P[3] is positive: the baseline has the wrong sign (left "
        "and right swapped?)");
  CHECK(stereo_error(kLeft, replaced(kRight, "-130.26", ".nan")) ==
        "right.yaml:9: projection_matrix.data: is not finite");
  CHECK(stereo_error(replaced(kLeft, "868.4", "-868.4"), kRight) ==
        "left.yaml:7: projection_matrix: the focal length must be positive");
  CHECK(stereo_error(replaced(kLeft, "506.3", "5063"), kRight) ==
        "left.yaml:7: projection_matrix: the principal point lies outside the image");
  CHECK(stereo_error(replaced(kLeft, "image_width: 1024", "image_width: 0"), kRight) ==
        "left.yaml:1: image_width: is no image size");
  CHECK(stereo_error(replaced(kLeft, "image_height: 768", "height: 768"), kRight) ==
        "left.yaml: image_height: is missing");
  CHECK(stereo_error(kLeft, replaced(kRight, "391.7, 0", "391.7")) ==
        "right.yaml:9: projection_matrix.data: must have 12 numbers");
  CHECK(stereo_error(kLeft, replaced(kRight, "391.7, 0,", "391.7, -3,")) ==
        "right.yaml:7: projection_matrix: a vertical baseline is not supported");
  CHECK(stereo_error(kLeft, replaced(kRight, "868.5", "abc")) ==
        "right.yaml:9: projection_matrix.data: must hold numbers only");
  CHECK(stereo_error(kLeft, "a: [1, 2").starts_with("right.yaml:1: not YAML: "));
  CHECK(stereo_error(kLeft, "") == "right.yaml: image_width: is missing");
  CHECK(stereo_error(kLeft, "just words") == "right.yaml:1: holds no keys and values");
  CHECK(stereo_error(kLeft, std::string((1 << 20) + 5, '#')) == "right.yaml: is larger than 1 MB");
  CHECK(stereo_error(kLeft, replaced(kRight, "image_width: 1024", "image_width: 1000"))
            .starts_with("right.yaml:1: image_width: the size differs from that of "));
  CHECK(stereo_error(kLeft, replaced(kRight, "506.3", "507.3"))
            .starts_with("right.yaml:7: projection_matrix: the pair is not rectified: entry 2"));
  CHECK(error_of([] { read_ros_stereo("/nowhere/left.yaml", "/nowhere/right.yaml"); }) ==
        "left.yaml: cannot be read");
  CHECK(error_of([] {
          read_fisheye(std::filesystem::temp_directory_path().string());
        }).ends_with(": cannot be read"));
}

TEST_CASE("Kalibr camchain: values") {
  const Folder folder;
  const auto cameras = read_kalibr_camchain(folder.write("chain.yaml", kChain));
  REQUIRE(cameras.size() == 2);
  CHECK(cameras[0].name == "cam0");
  const auto& pinhole = std::get<Calibrated<Pinhole>>(cameras[0].camera);
  CHECK(pinhole.params == std::array<double, 4>{460, 461, 365, 246});
  CHECK(cameras[0].radtan == std::array<double, 4>{-0.28, 0.07, 0.0002, 1.8e-5});
  CHECK_FALSE(cameras[0].camera_from_previous.has_value());
  const auto& fisheye = std::get<Calibrated<KannalaBrandt>>(cameras[1].camera);
  CHECK(fisheye.params == kFisheye);
  CHECK(fisheye.width == 1024);
  CHECK(fisheye.height == 1023);
  REQUIRE(cameras[1].camera_from_previous.has_value());
  CHECK(
      (*cameras[1].camera_from_previous * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0.1, 1.2, 0.3))
          .norm() < 1e-15);
}

TEST_CASE("Kalibr camchain: each fault has its line") {
  CHECK(chain_error(replaced(kChain, "camera_model: pinhole", "camera_model: omni")) ==
        "chain.yaml:2: cam0.camera_model: 'omni' is not supported (pinhole is)");
  CHECK(chain_error(replaced(kChain, "equidistant", "fov")) ==
        "chain.yaml:16: cam1.distortion_model: 'fov' is not supported (equidistant, radtan, none "
        "are)");
  CHECK(chain_error(replaced(kChain, "[460.0, 461.0, ", "[460.0, ")) ==
        "chain.yaml:3: cam0.intrinsics: must have 4 numbers");
  CHECK(chain_error(replaced(kChain, "-1.0, 0.0, 0.1", "-1.1, 0.0, 0.1")) ==
        "chain.yaml:10: cam1.T_cn_cnm1: is no rigid transform");
  CHECK(chain_error(replaced(kChain, "resolution", "size")) ==
        "chain.yaml: cam0.resolution: is missing");
  CHECK(chain_error("cam3: {}\n") == "chain.yaml: cam0: is missing");
  CHECK(chain_error("cam0: 3\n") == "chain.yaml:1: cam0: must hold keys and values");
}

TEST_CASE("Fisheye: the same numbers from every kind of file") {
  const Folder folder;
  const std::string prefixed =
      "Camera.fx: 302.7\nCamera.fy: 302.4\nCamera.cx: 514.9\nCamera.cy: 508.3\nCamera.k1: "
      "-0.0184\nCamera.k2: 0.0117\nCamera.k3: -0.0093\nCamera.k4: 0.0021\nCamera.width: "
      "1024\nCamera.height: 1023\n";
  for (const std::string& text : {kOpenCv, kPlain, kOpenCv + kPlain, prefixed, kChain}) {
    const auto camera = read_fisheye(folder.write("fish.yaml", text));
    CHECK(camera.params == kFisheye);
    CHECK(camera.width == (text == kPlain ? 0 : 1024));
    CHECK(camera.height == (text == kPlain ? 0 : 1023));
  }
}

TEST_CASE("Fisheye: each fault has its line") {
  CHECK(fisheye_error(kOpenCv + replaced(kPlain, "302.4", "302.5")) ==
        "fish.yaml:5: camera_matrix: contradicts fx");
  CHECK(fisheye_error(replaced(kPlain, "k3: -0.0093\n", "")) == "fish.yaml: k3: is missing");
  CHECK(fisheye_error(replaced(kPlain, "302.7", ".inf")) == "fish.yaml:1: fx: is not finite");
  CHECK(fisheye_error(replaced(kPlain, "302.7", "0")) ==
        "fish.yaml:1: fx: the focal length must be positive");
  CHECK(fisheye_error("distortion_model: plumb_bob\n" + kPlain) ==
        "fish.yaml:1: distortion_model: 'plumb_bob' is no fisheye (equidistant is)");
  CHECK(fisheye_error(replaced(kOpenCv, "rows: 4", "rows: 5")) ==
        "fish.yaml:11: distortion_coefficients: a fisheye has 4 of them");
  CHECK(fisheye_error("a: 1\n") == "fish.yaml: fx: neither it nor cam0 nor camera_matrix is there");
  CHECK(fisheye_error(replaced(kChain, "equidistant", "none")) ==
        "fish.yaml:2: cam0: no camera of this chain is a fisheye (pinhole, equidistant)");
  CHECK(fisheye_error(replaced(kChain, "radtan", "equidistant")) ==
        "fish.yaml:9: cam1: is a second fisheye, and one is expected");
}

TEST_CASE("Calibration of the rendered underwater dataset") {
  const char* data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr) {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
    return;
  }
  const std::string folder = std::string(data) + "/uwsynth/hybrid/calibration/";
  const auto stereo = read_ros_stereo(folder + "left_camera.yaml", folder + "right_camera.yaml");
  CHECK(stereo.params[4] == Approx(0.1502).margin(1e-6));
  CHECK(stereo.width == 1024);
  const auto fisheye = read_fisheye(folder + "fisheye_calib.yaml");
  CHECK(fisheye.params[0] == 302.734);
  CHECK(fisheye.params[7] == 0.0021);
  CHECK(fisheye.height == 1024);
}

}  // namespace hybrid_slam
