#include "cameras/calibration/calibration_file.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "cameras/double_sphere.h"
#include "cameras/extended_unified.h"
#include "cameras/unified_radtan.h"
#include "test/support/shared_cases.h"

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
        "chain.yaml:3: cam0.intrinsics: must have 5 numbers");
  CHECK(chain_error(replaced(kChain, "camera_model: pinhole", "camera_model: ds")) ==
        "chain.yaml:4: cam0.distortion_model: must be none with this camera_model");
  CHECK(chain_error(replaced(kChain, "camera_model: pinhole", "camera_model: none")) ==
        "chain.yaml:2: cam0.camera_model: 'none' is not supported (pinhole, ds, eucm, omni are)");
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

namespace {

// A lens of every format, with what is said of it.
struct Lens {
  Calibrated<KannalaBrandt> camera;
  std::vector<std::string> warnings;
};

Lens read_lens(const std::string& text) {
  const Folder folder;
  Lens lens;
  lens.camera = read_fisheye(folder.write("lens.yaml", text), &lens.warnings);
  return lens;
}

// The distance between the projections of two models, at most, over rays up to `limit` [rad].
template <ProjectionModel A>
double largest_difference(const std::array<double, A::kParamCount>& a,
                          const Calibrated<KannalaBrandt>& b, double limit) {
  double largest = 0;
  for (int i = 0; i < 200; ++i) {
    const double theta = limit * i / 200, phi = 2.4 * i;
    const Eigen::Vector3d ray(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                              std::cos(theta));
    Eigen::Vector2d by_a, by_b;
    REQUIRE(A::project(a.data(), ray.data(), by_a.data()));
    REQUIRE(KannalaBrandt::project(b.params.data(), ray.data(), by_b.data()));
    largest = std::max(largest, (by_a - by_b).norm());
  }
  return largest;
}

}  // namespace

TEST_CASE("Fisheye: words of a file stand in one line of an error") {
  CHECK(
      fisheye_error("cam0:\n  camera_model: \"pin\\nhole\"\n  distortion_model: none\n"
                    "  resolution: [4, 4]\n") ==
      "fish.yaml:2: cam0.camera_model: 'pin?hole' is not supported (pinhole, ds, eucm, omni are)");
  // The parser's own words hold the character that it does not know.
  CHECK(fisheye_error("a: \"\\\n\"\n").find('\n') == std::string::npos);
  CHECK(fisheye_error("a: \"\\\x1e\"\n").find('\x1e') == std::string::npos);
}

TEST_CASE("Fisheye: formats of ORB-SLAM3, stella_vslam, Basalt and ROS 2") {
  const std::string orbslam3 =
      "%YAML:1.0\nFile.version: \"1.0\"\nCamera.type: \"KannalaBrandt8\"\nCamera1.fx: 302.7\n"
      "Camera1.fy: 302.4\nCamera1.cx: 514.9\nCamera1.cy: 508.3\nCamera1.k1: -0.0184\n"
      "Camera1.k2: 0.0117\nCamera1.k3: -0.0093\nCamera1.k4: 0.0021\nCamera.width: 1024\n"
      "Camera.height: 1023\n";
  const std::string stella =
      "Camera:\n  name: \"wrist\"\n  setup: \"monocular\"\n  model: \"fisheye\"\n  fx: 302.7\n"
      "  fy: 302.4\n  cx: 514.9\n  cy: 508.3\n  k1: -0.0184\n  k2: 0.0117\n  k3: -0.0093\n"
      "  k4: 0.0021\n  fps: 3.0\n  cols: 1024\n  rows: 1023\n  color_order: \"Gray\"\n";
  const std::string basalt = R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0,
      "qy": 0, "qz": 0, "qw": 1}], "intrinsics": [{"camera_type": "kb4", "intrinsics":
      {"fx": 302.7, "fy": 302.4, "cx": 514.9, "cy": 508.3, "k1": -0.0184, "k2": 0.0117,
       "k3": -0.0093, "k4": 0.0021}}], "resolution": [[1024, 1023]]}})";
  const std::string camera_info =
      "header:\n  frame_id: wrist\nheight: 1023\nwidth: 1024\ndistortion_model: equidistant\n"
      "d:\n- -0.0184\n- 0.0117\n- -0.0093\n- 0.0021\n"
      "k: [302.7, 0.0, 514.9, 0.0, 302.4, 508.3, 0.0, 0.0, 1.0]\n---\nheight: 7\n";
  for (const std::string& text : {orbslam3, stella, basalt, camera_info}) {
    INFO(text);
    const Lens lens = read_lens(text);
    CHECK(lens.camera.params == kFisheye);
    CHECK(lens.camera.width == 1024);
    CHECK(lens.camera.height == 1023);
    CHECK(lens.warnings.empty());
  }
  CHECK(fisheye_error(replaced(stella, "\"fisheye\"", "\"perspective\"")) ==
        "fish.yaml:4: Camera.model: 'perspective' is no fisheye (fisheye is)");
  CHECK(fisheye_error(replaced(basalt, "kb4", "pinhole")).find("no camera_type is that") !=
        std::string::npos);
  CHECK(fisheye_error(replaced(basalt, "[[1024, 1023]]", "[]")).find("must have 1 rows") !=
        std::string::npos);
  CHECK(fisheye_error(replaced(camera_info, "- 0.0021\n", "- 0.0021\n- 0\n")) ==
        "fish.yaml:7: d: a fisheye has 4 of them");
}

TEST_CASE("Fisheye: double sphere, extended unified and omni become Kannala-Brandt") {
  const auto chain = [](const std::string& model, const std::string& intrinsics,
                        const std::string& distortion) {
    return "cam0:\n  camera_model: " + model + "\n  intrinsics: " + intrinsics + "\n  " +
           distortion + "\n  resolution: [1024, 1024]\n";
  };
  const std::string none = "distortion_model: none\n  distortion_coeffs: []";
  const Lens ds = read_lens(chain("ds", "[-0.27, 0.57, 218.5, 218.4, 512.7, 508.9]", none));
  CHECK(largest_difference<DoubleSphere>({218.5, 218.4, 512.7, 508.9, -0.27, 0.57}, ds.camera,
                                         1.5) < 0.3);
  REQUIRE(ds.warnings.size() == 1);
  CHECK(ds.warnings[0].find("double sphere, taken as Kannala-Brandt") != std::string::npos);
  const Lens eucm = read_lens(chain("eucm", "[0.62, 1.1, 301.5, 300.4, 512.7, 508.9]", none));
  CHECK(largest_difference<ExtendedUnified>({301.5, 300.4, 512.7, 508.9, 0.62, 1.1}, eucm.camera,
                                            1.4) < 0.3);
  const Lens omni = read_lens(
      chain("omni", "[1.2, 720, 721, 512.7, 508.9]",
            "distortion_model: radtan\n  distortion_coeffs: [-0.02, 0.01, 0.0001, -0.0001]"));
  CHECK(largest_difference<UnifiedRadtan>(
            {720, 721, 512.7, 508.9, 1.2, -0.02, 0.01, 0.0001, -0.0001}, omni.camera, 1.3) < 0.5);
  const std::string basalt = R"({"value0": {"intrinsics": [{"camera_type": "ds", "intrinsics":
      {"fx": 218.5, "fy": 218.4, "cx": 512.7, "cy": 508.9, "xi": -0.27, "alpha": 0.57}}],
      "resolution": [[1024, 1024]]}})";
  CHECK(read_lens(basalt).camera.params == ds.camera.params);
}

TEST_CASE("Fisheye: a section of that name is the lens, and a small skew is said") {
  const std::string blocks =
      "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0, 0, 0, 0]\n"
      "  distortion_model: equidistant\n  intrinsics: [1000, 1000, 1224, 1024]\n"
      "  resolution: [2448, 2048]\n"
      "fisheye:\n  distortion_coeffs: [0.0227, -0.0134, 0.013, -0.0042]\n"
      "  intrinsics: [774.7, 774.1, 1267.7, 1022.3]\n  resolution: [2448, 2048]\n";
  const Lens lens = read_lens(blocks);
  CHECK(lens.camera.params ==
        std::array<double, 8>{774.7, 774.1, 1267.7, 1022.3, 0.0227, -0.0134, 0.013, -0.0042});
  REQUIRE(lens.warnings.size() == 1);
  CHECK(lens.warnings[0].find("took the section fisheye for the lens, not cam0") !=
        std::string::npos);

  const Lens skewed = read_lens(replaced(kOpenCv, "302.7, 0.", "302.7, -0.215"));
  CHECK(skewed.camera.params == kFisheye);
  REQUIRE(skewed.warnings.size() == 1);
  CHECK(skewed.warnings[0].find(
            "the skew of -0.215 px is left out; it moves the border by 0.36 px") !=
        std::string::npos);
  CHECK(read_lens(replaced(kOpenCv, "302.7, 0.", "302.7, 0.01")).warnings.empty());
  CHECK(fisheye_error(replaced(kOpenCv, "302.7, 0.", "302.7, 30")).find("too much") !=
        std::string::npos);

  const Lens mixed =
      read_lens(replaced(replaced(kChain, "pinhole", "omni"), "[460.0, 461.0, 365.0, 246.0]",
                         "[1.2, 720, 721, 365, 246]"));
  CHECK(mixed.camera.params == kFisheye);
  REQUIRE(mixed.warnings.size() == 1);
  CHECK(mixed.warnings[0].find("both cam1 and cam0 could be the fisheye; took cam1") !=
        std::string::npos);
}

TEST_CASE("Fisheye: the cases as their users had them") {
  const auto cases = shared_cases("calibration");
  if (!cases) return;
  const std::array<double, 8> wrist{302.734, 302.411, 514.862, 508.337,
                                    -0.0184, 0.0117,  -0.0093, 0.0021};
  for (const char* const name :
       {"fisheye_calib.yaml", "kalibr_mixed_chain.yaml", "orbslam3_v1.yaml"}) {
    INFO(name);
    CHECK(read_fisheye(*cases / name).params == wrist);
  }
  CHECK(read_fisheye(*cases / "fisheye_two_blocks.yaml").params[0] == 774.7);
  const auto ds = read_fisheye(*cases / "kalibr_ds.yaml");
  CHECK(largest_difference<DoubleSphere>({218.5, 218.4, 512.7, 508.9, -0.27, 0.57}, ds, 1.5) < 0.3);
  const auto stereo = read_ros_stereo((*cases / "left_camera.yaml").string(),
                                      (*cases / "right_camera.yaml").string());
  CHECK(stereo.params[4] == Approx(0.1502).margin(1e-6));
}

TEST_CASE("ROS stereo: CameraInfo messages") {
  const auto info = [](const std::string& p3) {
    return "height: 768\nwidth: 1024\ndistortion_model: plumb_bob\nd: [0, 0, 0, 0, 0]\n"
           "k: [870, 0, 500, 0, 870, 390, 0, 0, 1]\nr: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
           "p: [868.4, 0, 506.3, " +
           p3 + ", 0, 868.5, 391.7, 0, 0, 0, 1, 0]\n---\n";
  };
  const Folder folder;
  const auto stereo = read_ros_stereo(folder.write("left.yaml", info("0")),
                                      folder.write("right.yaml", info("-130.26")));
  CHECK(stereo.params[1] == 868.5);
  CHECK(stereo.params[4] == Approx(0.15));
  CHECK(stereo.height == 768);
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
