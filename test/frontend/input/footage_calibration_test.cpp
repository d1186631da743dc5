#include "frontend/input/footage.h"

#include <cmath>

#include "frontend/input/footage_calibration.h"
#include "test/frontend/input/dataset_writer.h"
#include "test/frontend/input/small_footage.h"

namespace hybrid_slam {
namespace {

using namespace small_footage;

TEST_CASE("Own footage: ROS calibrations hold of raw and of rectified images") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), kThree);
  footage.rate = 10;
  footage.calibration = {(folder.path() / "l.yaml").string(), (folder.path() / "r.yaml").string()};
  write_text(footage.calibration[0], ros(0, 0.03, -0.1));
  write_text(footage.calibration[1], ros(-9.6, -0.02, -0.1));
  const auto meanings = footage_meanings(footage);
  CHECK(meanings.raw);
  CHECK(meanings.rectified);
  CHECK(open_rectified(footage)->info().stereo.params ==
        std::array<double, 5>{80, 80, 47.5, 31.5, 0.12});
  CHECK(holds(open_rectified(footage)->read(1).right, picture_of(1, 1)));
  // The cameras stand where the rotations and the baseline say: x_left = Rl^T x, and so on.
  const PairCalibration pair = read_pair_calibration(footage.calibration, false, {96, 64});
  REQUIRE(pair.raw);
  const Eigen::AngleAxisd left(0.03, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd right(-0.02, Eigen::Vector3d::UnitY());
  const Eigen::Vector3d point(0.3, -0.2, 2);  // in the rectified left camera
  const Eigen::Vector3d in_right = pair.raw->right_from_left * (left.inverse() * point);
  CHECK((in_right - right.inverse() * (point - Eigen::Vector3d(0.12, 0, 0))).norm() < 1e-12);
  CHECK(pair.raw->left.fx == 82);
  CHECK(pair.raw->left.distortion[0] == -0.1);
  // Rectifying keeps the baseline.
  CHECK(open_footage(footage, FootageImages::kRaw, {})->info().stereo.params[4] ==
        Approx(0.12).margin(1e-9));

  // Neither distortion nor rotation, and one matrix: there is nothing to rectify.
  write_text(footage.calibration[0], ros(0, 0, 0));
  write_text(footage.calibration[1], ros(-9.6, 0, 0));
  CHECK(footage_meanings(footage).raw);  // the matrices differ
  for (const std::string& path : footage.calibration) {
    replace_text(path, "[82, 0, 46, 0, 82, 33, 0, 0, 1]", "[80, 0, 47.5, 0, 80, 31.5, 0, 0, 1]");
  }
  CHECK_FALSE(footage_meanings(footage).raw);
}

TEST_CASE("Own footage: Kalibr's and ORB-SLAM's pairs") {
  const TempFolder folder;
  const fs::path chain = folder.path() / "chain.yaml";
  const std::string camera =
      "  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [-0.1, 0.01, 0, "
      "0]\n  intrinsics: [80, 80, 47.5, 31.5]\n  resolution: [96, 64]\n";
  write_text(chain, "cam0:\n" + camera + "cam1:\n" + camera +
                        "  T_cn_cnm1: [[1, 0, 0, -0.11], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, "
                        "1]]\n");
  const auto kalibr = read_pair_calibration({chain.string()}, false, {96, 64});
  REQUIRE(kalibr.raw);
  CHECK(kalibr.files_used == 1);
  CHECK(kalibr.raw->right_from_left.translation().x() == Approx(-0.11));

  const fs::path orb = folder.path() / "orb.yaml";
  const std::string matrix = "!!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: [1, 0, 0, ";
  const std::string cameras =
      "%YAML:1.0\nCamera1.fx: 80.0\nCamera1.fy: 81.0\nCamera1.cx: 47.5\nCamera1.cy: 31.5\n"
      "Camera1.k1: -0.1\nCamera1.k2: 0.01\nCamera1.p1: 0.001\nCamera1.p2: 0.002\n"
      "Camera2.fx: 82.0\nCamera2.fy: 83.0\nCamera2.cx: 47.5\nCamera2.cy: 31.5\n"
      "Camera2.k1: 0.3\nCamera2.k2: 0.0\nCamera2.k3: 0.4\nCamera2.k4: 0.5\n"
      "Stereo.T_c1_c2: " +
      matrix + "0.11, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n";
  write_text(orb, cameras + "Camera.type: \"PinHole\"\n");
  const auto pinhole = read_pair_calibration({orb.string()}, false, {96, 64});
  REQUIRE(pinhole.raw);
  CHECK(pinhole.raw->left.fy == 81);
  CHECK(pinhole.raw->left.distortion == std::vector<double>{-0.1, 0.01, 0.001, 0.002, 0});
  CHECK(pinhole.raw->left.size == ImageSize{96, 64});
  CHECK(pinhole.raw->right_from_left.translation().x() == Approx(-0.11));

  write_text(orb,
             "Camera.type: \"Rectified\"\nCamera1.fx: 80.0\nCamera1.fy: 80.0\n"
             "Camera1.cx: 47.5\nCamera1.cy: 31.5\nStereo.b: 0.12\n");
  const auto rectified = read_pair_calibration({orb.string()}, false, {96, 64});
  REQUIRE(rectified.rectified);
  CHECK(rectified.rectified->params == std::array<double, 5>{80, 80, 47.5, 31.5, 0.12});
  write_text(orb,
             "Camera.fx: 80.0\nCamera.fy: 80.0\nCamera.cx: 47.5\nCamera.cy: 31.5\n"
             "Camera.bf: 8.0\n");
  const auto bf = read_pair_calibration({orb.string()}, false, {96, 64});
  CHECK(bf.rectified->params[4] == Approx(0.1));
}

TEST_CASE("Own footage: lenses of other models in a pair are said to be taken as Kannala-Brandt") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), kThree);
  footage.rate = 5;
  const std::string camera =
      "  camera_model: ds\n  distortion_model: none\n  distortion_coeffs: []\n"
      "  intrinsics: [-0.2, 0.55, 40, 40, 47.5, 31.5]\n  resolution: [96, 64]\n";
  footage.calibration = {(folder.path() / "chain.yaml").string()};
  write_text(footage.calibration[0],
             "cam0:\n" + camera + "cam1:\n" + camera +
                 "  T_cn_cnm1: [[1, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n");
  const auto warnings = open_footage(footage, FootageImages::kRaw, {})->info().warnings;
  REQUIRE(warnings.size() >= 2);
  check_holds(warnings[0], "chain.yaml: cam0: double sphere, taken as Kannala-Brandt");
  check_holds(warnings[1], "chain.yaml: cam1: double sphere, taken as Kannala-Brandt");
}

// Raw cameras turned by 0.01 to either side, as ORB-SLAM2 and stella_vslam have them.
TEST_CASE("Own footage: settings of programs that rectify hold of raw and of rectified images") {
  const TempFolder folder;
  const std::string path = (folder.path() / "settings.yaml").string();
  const double c = std::cos(0.01), s = std::sin(0.01);
  const auto check_pair = [&](const std::string& text) {
    INFO(text);
    write_text(path, text);
    const PairCalibration pair = read_pair_calibration({path}, false, {96, 64});
    REQUIRE(pair.rectified);
    CHECK(pair.rectified->params[0] == 80);
    CHECK(pair.rectified->params[3] == 31.5);
    CHECK(pair.rectified->params[4] == Approx(0.11));
    REQUIRE(pair.raw);
    CHECK(pair.raw->left.fx == 82);
    CHECK(pair.raw->left.cy == 33);
    CHECK(pair.raw->right.distortion == std::vector<double>{-0.1, 0.01, 0, 0, 0.5});
    CHECK(pair.raw->left.size == ImageSize{96, 64});
    const Rigid3d& right_from_left = pair.raw->right_from_left;
    CHECK(right_from_left.rotation().angularDistance(Eigen::Quaterniond::Identity()) ==
          Approx(0.02));
    CHECK(right_from_left.translation().norm() == Approx(0.11));
    CHECK(right_from_left.translation().x() == Approx(-0.11 * c));
  };
  const auto opencv = [](const std::string& key, const std::string& size, const std::string& data) {
    return key + ": !!opencv-matrix\n  " + size + "\n  dt: d\n  data: " + data;
  };
  const std::string k = numbers({82, 0, 46, 0, 82, 33, 0, 0, 1});
  const std::string d = numbers({-0.1, 0.01, 0, 0, 0.5});
  const std::string left = numbers({c, 0, s, 0, 1, 0, -s, 0, c});
  const std::string right = numbers({c, 0, -s, 0, 1, 0, s, 0, c});
  std::string orb =
      "%YAML:1.0\nCamera.fx: 80.0\nCamera.fy: 80.0\nCamera.cx: 47.5\nCamera.cy: 31.5\n"
      "Camera.bf: 8.8\n";
  for (const std::string side : {"LEFT", "RIGHT"}) {
    orb += side + ".height: 64\n" + side + ".width: 96\n" +
           opencv(side + ".D", "rows: 1\n  cols: 5", d) +
           opencv(side + ".K", "rows: 3\n  cols: 3", k) +
           opencv(side + ".R", "rows: 3\n  cols: 3", side == "LEFT" ? left : right);
  }
  check_pair(orb);

  const auto stella = [&](const std::string& section, const std::string& rectifier) {
    std::string text = section.empty() ? "Camera:\n" : "";
    const std::string before = section.empty() ? "  " : "Camera.";
    for (const char* const line :
         {"name: \"a\"", "setup: \"stereo\"", "model: \"perspective\"", "fx: 80.0", "fy: 80.0",
          "cx: 47.5", "cy: 31.5", "k1: 0.0", "fps: 20.0", "cols: 96", "rows: 64",
          "focal_x_baseline: 8.8", "color_order: \"Gray\""}) {
      text += before + line + "\n";
    }
    if (rectifier.empty()) return text;
    text += section.empty() ? "StereoRectifier:\n" : "";
    const std::string in = section.empty() ? "  " : "StereoRectifier.";
    for (const std::string side : {"left", "right"}) {
      text += in + "K_" + side + ": " + k + in + "D_" + side + ": " + d + in + "R_" + side + ": " +
              (side == "left" ? left : right);
    }
    return text;
  };
  check_pair(stella("", "with"));
  check_pair(stella("Camera", "with"));  // as OpenVSLAM wrote it
  write_text(path, stella("", ""));
  const PairCalibration rectified = read_pair_calibration({path}, false, {96, 64});
  CHECK(rectified.rectified->params[4] == Approx(0.11));
  CHECK(!rectified.raw);
  write_text(path, "Camera:\n  model: \"fisheye\"\n  focal_x_baseline: 8\n");
  check_holds(complaint([&] {
                read_pair_calibration({path}, false, {96, 64});
              }),
              "settings.yaml:2: Camera.model: 'fisheye' is not supported of a rectified pair");
}

TEST_CASE("Own footage: Basalt's pair") {
  const TempFolder folder;
  const fs::path path = folder.path() / "basalt.json";
  // The right camera 0.11 m to the right of the left one, both turned by 90 degrees about z in the
  // IMU.
  const std::string pose =
      R"("qx": 0, "qy": 0, "qz": 0.70710678118654752, "qw": 0.70710678118654752})";
  const std::string fisheye =
      R"({"camera_type": "kb4", "intrinsics": {"fx": 80, "fy": 81, "cx": 47.5,
      "cy": 31.5, "k1": 0.1, "k2": 0.02, "k3": 0.003, "k4": 0.0004}})";
  const std::string pinhole =
      R"({"camera_type": "pinhole-radtan8", "intrinsics": {"fx": 82, "fy": 83,
      "cx": 47.5, "cy": 31.5, "k1": -0.1, "k2": 0.02, "p1": 0.003, "p2": 0.004, "k3": 0.05,
      "k4": 0.06, "k5": 0.07, "k6": 0.08, "rpmax": 2.5}})";
  const auto write = [&](const std::string& left, const std::string& right) {
    write_text(path, R"({"value0": {"T_imu_cam": [{"px": 1, "py": 2, "pz": 3, )" + pose +
                         R"(, {"px": 1, "py": 2.11, "pz": 3, )" + pose + R"(], "intrinsics": [)" +
                         left + ", " + right + R"(], "resolution": [[96, 64], [96, 64]]}})");
    return read_pair_calibration({path.string()}, false, {96, 64});
  };
  const PairCalibration lenses = write(fisheye, fisheye);
  CHECK(lenses.files_used == 1);
  CHECK(!lenses.rectified);
  REQUIRE(lenses.raw);
  CHECK(lenses.raw->left.is_fisheye);
  CHECK(lenses.raw->left.distortion == std::vector<double>{0.1, 0.02, 0.003, 0.0004});
  CHECK(lenses.raw->left.fy == 81);
  CHECK(lenses.raw->right.size == ImageSize{96, 64});
  CHECK(Eigen::Vector3d(lenses.raw->right_from_left.translation())
            .isApprox(Eigen::Vector3d(-0.11, 0, 0), 1e-12));
  CHECK(lenses.raw->right_from_left.rotation().angularDistance(Eigen::Quaterniond::Identity()) <
        1e-12);
  const PairCalibration mixed = write(fisheye, pinhole);
  CHECK(!mixed.raw->right.is_fisheye);
  CHECK(mixed.raw->right.distortion ==  // OpenCV's order
        std::vector<double>{-0.1, 0.02, 0.003, 0.004, 0.05, 0.06, 0.07, 0.08});
  check_holds(complaint([&] { write(fisheye, R"({"camera_type": "fov", "intrinsics": {}})"); }),
              "intrinsics[1].camera_type: 'fov' is not supported");

  Footage footage = write_footage(folder.path(), kThree);
  footage.calibration = {path.string()};
  write(fisheye, fisheye);
  footage.rate = 5;
  const auto sequence = open_footage(footage, FootageImages::kRaw, {});
  CHECK(sequence->info().stereo.params[4] == Approx(0.11).epsilon(1e-9));
  CHECK(!holds(sequence->read(1).left, picture_of(1, 0)));
  write_text(path, R"({"value0": {"T_imu_cam": [{"px": 1, "py": 2, "pz": 3, )" + pose +
                       R"(], "intrinsics": [)" + fisheye + R"(], "resolution": [[96, 64]]}})");
  check_holds(refusal_of(footage, FootageImages::kRaw), "has one camera, and a pair has two");
}

TEST_CASE("Own footage: DSO's cameras") {
  const TempFolder folder;
  const fs::path left = folder.path() / "calib_0.txt", right = folder.path() / "calib_1.txt";
  const fs::path between = folder.path() / "calib_stereo.txt";
  const auto read = [&] {
    return read_pair_calibration({left.string(), right.string(), between.string()}, false,
                                 {96, 64});
  };
  write_text(left, "Pinhole 80 80 47.5 31.5 0.0 0.0\n96 64\ncrop\n96 64\n");
  write_text(right, "Pinhole 80 80 47.5 31.5 0\n96 64\n");
  write_text(between, "1 0 0 -0.12\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  const PairCalibration rectified = read();
  CHECK(rectified.files_used == 3);
  REQUIRE(rectified.rectified);
  CHECK(rectified.rectified->params == std::array<double, 5>{80, 80, 47.5, 31.5, 0.12});
  CHECK(!rectified.raw);

  write_text(right, "Pinhole 81 80 47.5 31.5 0\n96 64\n");  // no longer alike
  REQUIRE(read().raw);
  CHECK(read().raw->right.fx == 81);
  CHECK(read().raw->right_from_left.translation().x() == Approx(-0.12));

  // As fractions of the image, counted from its corner.
  write_text(left, "EquiDistant 0.5 0.75 0.5 0.5 0.1 0.02 0.003 0.0004\n96 64\n0.4 0.5\n96 64\n");
  write_text(right, "RadTan 80 80 47.5 31.5 -0.1 0.02 0.003 0.004\n96 64\n");
  const RawPair raw = read().raw.value();
  CHECK(raw.left.is_fisheye);
  CHECK(raw.left.fx == 48);
  CHECK(raw.left.fy == 48);
  CHECK(raw.left.cx == 47.5);
  CHECK(raw.left.cy == 31.5);
  CHECK(raw.left.distortion == std::vector<double>{0.1, 0.02, 0.003, 0.0004});
  CHECK(!raw.right.is_fisheye);
  CHECK(raw.right.distortion == std::vector<double>{-0.1, 0.02, 0.003, 0.004});

  const auto refused = [&](const fs::path& path, const std::string& text) {
    const std::string before = read_text(path);
    write_text(path, text);
    const std::string line = complaint(read);
    write_text(path, before);
    return line;
  };
  check_holds(refused(left, "FOV 0.5 0.5 0.5 0.5 0.9\n96 64\n"),
              "calib_0.txt:1: the camera model \"FOV\" is not supported (Pinhole, RadTan,");
  check_holds(refused(left, "Pinhole 80 80 47.5 31.5 0.1\n96 64\n"), "Pinhole has 4 numbers");
  check_holds(refused(left, "RadTan 80 80 47.5\n96 64\n"), "RadTan has 8 numbers");
  check_holds(refused(right, "Pinhole 80 80 47.5 31.5\n"), "calib_1.txt: expected a line of");
  check_holds(refused(right, "Pinhole 80 80 47.5 31.5\n96 -64\n"), "calib_1.txt:2: is no size");
  check_holds(refused(between, "1 0 0\n0 1 0\n"), "calib_stereo.txt: expected a matrix of 4x4");
  check_holds(refused(between, "2 0 0 1\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"), "is not a rotation");
  check_holds(complaint([&] {
                read_pair_calibration({left.string()}, false, {96, 64});
              }),
              "that of the right one and the 4x4 matrix right_from_left must follow");
}

}  // namespace
}  // namespace hybrid_slam
