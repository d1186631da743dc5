#include "frontend/input/footage.h"

#include <cmath>
#include <iostream>
#include <sstream>

#include "frontend/input/child_output.h"
#include "frontend/input/footage_calibration.h"
#include "frontend/input/footage_images.h"
#include "frontend/input/part_of_sequence.h"
#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

using Names = std::vector<std::string>;

constexpr int kWidth = 96;
constexpr int kHeight = 64;

cv::Mat picture_of(int frame, int side) { return test_picture(kWidth, kHeight, 10 * frame + side); }

// Images of these names (without ending), in a folder.
void write_images(const fs::path& folder, const Names& names, int side) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    write_picture(folder / (names[i] + ".png"), picture_of(static_cast<int>(i), side));
  }
}

struct Listed {
  NameOrder order;
  std::vector<std::int64_t> keys;
};

Listed listed(const Names& names) {
  const TempFolder folder;
  write_images(folder.path(), names, 0);
  const FootageList list = list_footage({folder.path().string()});
  Listed result{list.order, {}};
  for (const FootageImage& image : list.images) result.keys.push_back(image.key);
  return result;
}

using Keys = std::vector<std::int64_t>;

std::string kitti_calibration() {
  return "P0: 80 0 47.5 0 0 80 31.5 0 0 0 1 0\nP1: 80 0 47.5 -9.6 0 80 31.5 0 0 0 1 0\n"
         "P2: 80 0 47.5 4 0 80 31.5 0 0 0 1 0\nP3: 80 0 47.5 -12 0 80 31.5 0 0 0 1 0\n";
}

std::string numbers(std::initializer_list<double> values) {
  std::ostringstream text;
  text.precision(17);
  const char* before = "[";
  for (const double value : values) {
    text << before << value;
    before = ", ";
  }
  text << "]\n";
  return text.str();
}

std::string sensor(double x, double turn) {
  const double c = std::cos(turn), s = std::sin(turn);
  return "T_BS:\n  cols: 4\n  rows: 4\n  data: " +
         numbers({c, 0, s, x, 0, 1, 0, 0, -s, 0, c, 0, 0, 0, 0, 1}) +
         "resolution: [96, 64]\ncamera_model: pinhole\nintrinsics: [80, 80, 47.5, 31.5]\n"
         "distortion_model: radial-tangential\ndistortion_coefficients: [-0.1, 0.01, 0, 0]\n";
}

// As camera_calibration writes it; the raw camera is turned by `turn` about the vertical.
std::string ros(double p3, double turn, double k1) {
  const double c = std::cos(turn), s = std::sin(turn);
  return "image_width: 96\nimage_height: 64\n"
         "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [82, 0, 46, 0, 82, 33, 0, 0, 1]\n"
         "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: " +
         numbers({k1, 0, 0, 0, 0}) + "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: " +
         numbers({c, 0, s, 0, 1, 0, -s, 0, c}) +
         "projection_matrix:\n  rows: 3\n  cols: 4\n  data: " +
         numbers({80, 0, 47.5, p3, 0, 80, 31.5, 0, 0, 0, 1, 0});
}

// Three frames in left/ and right/ with these names.
Footage write_footage(const fs::path& root, const Names& names) {
  write_images(root / "left", names, 0);
  write_images(root / "right", names, 1);
  write_text(root / "calib.txt", kitti_calibration());
  Footage footage;
  footage.left = {(root / "left").string()};
  footage.right = {(root / "right").string()};
  footage.calibration = {(root / "calib.txt").string()};
  return footage;
}

const Names kThree{"000000", "000001", "000002"};

std::unique_ptr<ImageSequence> open_rectified(const Footage& footage) {
  return open_footage(footage, FootageImages::kRectified, {});
}

std::string refusal_of(const Footage& footage, FootageImages images = FootageImages::kRectified) {
  return complaint([&] { open_footage(footage, images, {}); });
}

void check_holds(const std::string& text, const std::string& part) {
  INFO(text);
  CHECK(text.find(part) != std::string::npos);
}

void check_same_frames(const ImageSequence& a, const ImageSequence& b) {
  REQUIRE(a.size() == b.size());
  CHECK(a.info().times == b.info().times);
  CHECK(a.info().stereo.params == b.info().stereo.params);
  for (std::size_t i = 0; i < a.size(); ++i) {
    const FrameImages x = a.read(i), y = b.read(i);
    CHECK(x.left.pixels == y.left.pixels);
    CHECK(x.right.pixels == y.right.pixels);
    CHECK(x.time == y.time);
  }
}

}  // namespace

TEST_CASE("Own footage: what names of images tell") {
  CHECK(listed({"left_0010", "left_0011", "left_0009"}).keys == Keys{9, 10, 11});
  CHECK(listed({"left_0010", "left_0011"}).order == NameOrder::kNumbers);
  CHECK(listed({"9", "10", "100"}).keys == Keys{9, 10, 100});
  CHECK(listed({"cam0_7_left", "cam0_8_left"}).keys == Keys{7, 8});

  const Listed nano = listed({"1403636579763555584", "1403636579813555456"});
  CHECK(nano.order == NameOrder::kStamps);
  CHECK(nano.keys == Keys{1403636579763555584, 1403636579813555456});
  CHECK(listed({"1403636579763555", "1403636579813555"}).keys ==
        Keys{1403636579763555000, 1403636579813555000});
  CHECK(listed({"1403636579763", "1403636579813"}).keys ==
        Keys{1403636579763000000, 1403636579813000000});
  // Seconds, also where only the fraction changes.
  CHECK(listed({"1403636579.763556", "1403636580.813556"}).keys ==
        Keys{1403636579763556000, 1403636580813556000});
  CHECK(listed({"frame-1403636579.763556", "frame-1403636579.813556"}).keys ==
        Keys{1403636579763556000, 1403636579813556000});
  CHECK(listed({"0.05", "12.5"}).keys == Keys{50000000, 12500000000});
  CHECK(listed({"1403636579_763556", "1403636580_013556"}).keys ==
        Keys{1403636579763556000, 1403636580013556000});
  // Not every point is a decimal one.
  CHECK(listed({"cam0.0001", "cam0.0002"}).keys == Keys{1, 2});
  // Several numbers: the order of the names.
  const Listed named = listed({"dive1_part1_03", "dive1_part2_01", "dive2_part1_02"});
  CHECK(named.order == NameOrder::kNames);
  CHECK(named.keys == Keys{0, 1, 2});
  check_holds(complaint([] { listed({"1", "01"}); }), "same number as");
}

TEST_CASE("Own footage: the same frames as KITTI's layout") {
  const TempFolder folder;
  const fs::path sequence = folder.path() / "sequences/07";
  write_images(sequence / "image_0", kThree, 0);
  write_images(sequence / "image_1", kThree, 1);
  write_text(sequence / "calib.txt", kitti_calibration());
  write_text(sequence / "times.txt", "0\n0.5\n1.25\n");
  const auto dataset = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  Footage footage;
  footage.left = {(sequence / "image_0").string()};
  footage.right = {(sequence / "image_1/*.png").string()};  // a folder or a pattern
  footage.calibration = {(sequence / "calib.txt").string()};
  footage.times = (sequence / "times.txt").string();
  check_same_frames(*dataset, *open_rectified(footage));
  CHECK_FALSE(footage_meanings(footage).raw);

  // Its colour cameras have a baseline of their own: (4 + 12) / 80.
  fs::rename(sequence / "image_0", sequence / "image_2");
  fs::rename(sequence / "image_1", sequence / "image_3");
  footage.left = {(sequence / "image_2").string()};
  footage.right = {(sequence / "image_3").string()};
  CHECK(open_rectified(footage)->info().stereo.params[4] == Approx(0.2).margin(1e-12));
}

TEST_CASE("Own footage: the same frames as EuRoC's layout") {
  const TempFolder folder;
  const Names names{"1403636579763555584", "1403636579813555456", "1403636579863555584"};
  for (int side = 0; side < 2; ++side) {
    const fs::path camera = folder.path() / (side == 0 ? "mav0/cam0" : "mav0/cam1");
    write_images(camera / "data", names, side);
    std::string list = "#timestamp [ns],filename\n";
    for (const std::string& name : names) list += name + "," + name + ".png\n";
    write_text(camera / "data.csv", list);
    write_text(camera / "sensor.yaml", sensor(0.12 * side, 0.02 * side));
  }
  const auto dataset = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  const fs::path mav = folder.path() / "mav0";
  Footage footage;
  footage.left = {(mav / "cam0/data").string()};
  footage.right = {(mav / "cam1/data").string()};
  footage.calibration = {(mav / "cam0/sensor.yaml").string(), (mav / "cam1/sensor.yaml").string()};
  const auto own = open_footage(footage, FootageImages::kRaw, {});
  check_same_frames(*dataset, *own);
  CHECK(own->info().times[0] == Approx(1403636579.763555584).epsilon(1e-15));
  CHECK_FALSE(footage_meanings(footage).rectified);
  check_holds(refusal_of(footage), "says how raw images are made");
  footage.calibration.pop_back();
  check_holds(refusal_of(footage, FootageImages::kRaw), "that of the right one must follow");
}

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

TEST_CASE("Own footage: times") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), {"left_010", "left_012", "left_013"});
  check_holds(refusal_of(footage), "the names tell no times; give --times FILE");
  footage.rate = 20;  // gaps between numbers stay
  CHECK(open_rectified(footage)->info().times == std::vector<double>{0, 0.1, 0.15});
  footage.rate = 0;
  footage.times = (folder.path() / "t").string();
  write_text(footage.times, "7\n8.5\n9\n");  // as many as frames
  CHECK(open_rectified(footage)->info().times == std::vector<double>{7, 8.5, 9});
  std::string rows;
  for (int i = 0; i < 20; ++i) rows += std::to_string(0.5 * i) + "\n";
  write_text(footage.times, rows);  // row n is that of number n
  CHECK(open_rectified(footage)->info().times == std::vector<double>{5, 6, 6.5});
  write_text(footage.times,
             "# time name\n1.5 left_010.png\n1.75 left_011.png\n2 left_012.png\n3 left_013.png\n");
  CHECK(open_rectified(footage)->info().times == std::vector<double>{1.5, 2, 3});
  write_text(footage.times,
             "timestamp,filename\n1403636579763555584,left_010.png\n"
             "1403636579813555584,left_012.png\n1403636579863555584,left_013.png\n");
  CHECK(open_rectified(footage)->info().times[1] == Approx(1403636579.813555584).epsilon(1e-15));
  write_text(footage.times,
             "#timestamp [ns],filename\n1000000000,left_010.png\n1100000000,left_012.png\n"
             "1200000000,left_013.png\n");
  CHECK(open_rectified(footage)->info().times[1] == Approx(1.1));
  // The name first, and an exposure behind.
  write_text(footage.times, "left_010 1.5 6.9\nleft_012 2.0 7.1\nleft_013 3.25 7\n");
  CHECK(open_rectified(footage)->info().times == std::vector<double>{1.5, 2, 3.25});
  write_text(footage.times, "2011-09-26 13:02:25.5\n2011-09-26 13:02:26\n2011-09-26 13:02:27\n");
  CHECK(open_rectified(footage)->info().times[0] == 1317042145.5);

  write_text(footage.times, "1\n2\n");
  check_holds(refusal_of(footage), "has 2 times for 3 frames of numbers 10 to 13");
  write_text(footage.times, "1.5 left_010.png\n2 left_012.png\n");
  check_holds(refusal_of(footage), "has no time of the left image \"left_013.png\"");
  write_text(footage.times, "1.5 left_010.png\n1 left_012.png\n3 left_013.png\n");
  check_holds(refusal_of(footage), "the times of frames 0 and 1 do not ascend");
}

TEST_CASE("Own footage: left, right and fisheye belong together by number or time") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), {"000000", "000001", "000002", "000003"});
  footage.rate = 5;
  fs::remove(folder.path() / "right/000002.png");
  const auto sequence = open_rectified(footage);
  REQUIRE(sequence->size() == 4);
  CHECK(holds(sequence->read(3).right, picture_of(3, 1)));
  check_holds(complaint([&] { sequence->read(2); }), "no right image");

  write_images(folder.path() / "fish", {"000000", "000003"}, 2);
  footage.fisheye = {(folder.path() / "fish").string()};
  check_holds(refusal_of(footage), "that of the fisheye must follow");
  const std::string lens = (folder.path() / "lens.yaml").string();
  write_text(lens,
             "image_width: 96\nimage_height: 64\nfx: 30\nfy: 30\ncx: 47\ncy: 31\nk1: 0\n"
             "k2: 0\nk3: 0\nk4: 0\n");
  footage.calibration.push_back(lens);
  const auto hybrid = open_rectified(footage);
  REQUIRE(hybrid->info().fisheye);
  CHECK(hybrid->info().fisheye->params[0] == 30);
  CHECK(holds(hybrid->read(3).fisheye, picture_of(1, 2)));
  CHECK(hybrid->read(1).fisheye.empty());
  footage.fisheye.clear();
  check_holds(refusal_of(footage), "lens.yaml: is one calibration too many");

  // Times in the names: a constant offset is taken out, what has no partner left out.
  fs::remove_all(folder.path() / "left");
  fs::remove_all(folder.path() / "right");
  write_images(folder.path() / "left", {"100.00", "100.10", "100.20", "100.30"}, 0);
  write_images(folder.path() / "right", {"100.004", "100.204", "100.304"}, 1);
  footage.calibration.pop_back();
  footage.rate = 0;
  const auto stamped = open_rectified(footage);
  REQUIRE(stamped->size() == 3);
  CHECK(stamped->info().times[0] == Approx(100).epsilon(1e-14));
  CHECK(stamped->info().times[1] == Approx(100.2).epsilon(1e-14));
  CHECK(holds(stamped->read(1).left, picture_of(2, 0)));
  CHECK(holds(stamped->read(1).right, picture_of(1, 1)));

  fs::remove_all(folder.path() / "right");
  write_images(folder.path() / "right", {"7", "8", "9", "10"}, 1);
  check_holds(refusal_of(footage),
              "the names of the left images tell times (100.00.png), those of "
              "the right ones numbers (7.png)");
}

TEST_CASE("Own footage: videos") {
  const TempFolder folder;
  const Names names{"000000", "000001", "000002", "000003", "000004"};
  Footage images = write_footage(folder.path(), names);
  images.rate = 8;
  Footage videos = images;
  videos.rate = 0;
  for (const char* const side : {"left", "right"}) {
    const std::string video = (folder.path() / side).string() + ".mkv";
    try {
      std::string ignored;
      ChildOutput made({"ffmpeg", "-v", "quiet", "-framerate", "8", "-i",
                        (folder.path() / side / "%06d.png").string(), "-c:v", "ffv1", "-pix_fmt",
                        "gray", video});
      REQUIRE(made.read_to_end(ignored));
    } catch (const InputError& error) {
      std::cout << "SKIPPED: " << error.what() << "\n";
      return;
    }
    (side == std::string("left") ? videos.left : videos.right) = {video};
  }
  const auto as_images = open_rectified(images);
  const auto sequence = open_rectified(videos);
  REQUIRE(sequence->size() == names.size());
  CHECK(sequence->info().stereo.params == as_images->info().stereo.params);
  for (const std::size_t frame : {0, 2, 3, 1, 4, 4}) {  // back, too
    CHECK(sequence->info().times[frame] == Approx(0.125 * static_cast<double>(frame)).margin(1e-9));
    CHECK(sequence->read(frame).left.pixels == as_images->read(frame).left.pixels);
    CHECK(sequence->read(frame).right.pixels == as_images->read(frame).right.pixels);
  }
  videos.rate = 16;
  CHECK(open_rectified(videos)->info().times[3] == Approx(3.0 / 16));
  videos.rate = 0;
  videos.times = (folder.path() / "t").string();
  write_text(videos.times, "1\n2\n4\n8\n16\n");
  CHECK(open_rectified(videos)->info().times[4] == 16);
  videos.right = {(folder.path() / "right").string()};
  check_holds(refusal_of(videos), "right: must be one video, as the left one is");
  write_text(folder.path() / "left.mkv", "no video");
  check_holds(refusal_of(videos), "left.mkv: is no video that can be read");
}

TEST_CASE("Own footage: what cannot be used is refused in one line") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), kThree);
  footage.rate = 5;
  SECTION("no such folder") {
    footage.right = {(folder.path() / "rihgt").string()};
    check_holds(refusal_of(footage), "rihgt: no such folder or file");
  }
  SECTION("nothing matches") {
    footage.left = {(folder.path() / "left/*.jpg").string()};
    check_holds(refusal_of(footage), "*.jpg: holds no images");
  }
  SECTION("the calibration of something else") {
    write_text(footage.calibration[0], "fx: 3\n");
    check_holds(refusal_of(footage), "calib.txt: is not the calibration of a stereo pair (KITTI's");
  }
  SECTION("raw images of which only the rectified pair is known") {
    check_holds(refusal_of(footage, FootageImages::kRaw),
                "does not tell how to rectify raw images");
  }
  SECTION("names without one number, and not as many") {
    write_images(folder.path() / "left", {"a1b1", "a2b2"}, 0);
    fs::remove(folder.path() / "left/000000.png");
    fs::remove_all(folder.path() / "right");
    write_images(folder.path() / "right", {"a1b1", "a2b2"}, 1);
    check_holds(refusal_of(footage), "names do not tell which belong together");
  }
  SECTION("the same images twice") {
    footage.right = footage.left;
    check_holds(refusal_of(footage), "left/000000.png: is a left and a right image");
  }
  SECTION("another size") {
    write_text(folder.path() / "l.yaml", ros(0, 0, 0));
    write_text(folder.path() / "r.yaml", ros(-9.6, 0, 0));
    replace_text(folder.path() / "l.yaml", "image_width: 96", "image_width: 192");
    replace_text(folder.path() / "r.yaml", "image_width: 96", "image_width: 192");
    footage.calibration = {(folder.path() / "l.yaml").string(),
                           (folder.path() / "r.yaml").string()};
    check_holds(refusal_of(footage), "calibrated for 192x64, but the images are 96x64");
  }
}

TEST_CASE("A part of a sequence") {
  const TempFolder folder;
  Footage footage =
      write_footage(folder.path(), {"0", "1", "2", "3", "4", "5", "6", "7", "8", "9"});
  footage.rate = 10;
  const auto part = part_of_sequence(open_rectified(footage), 3, 2);
  REQUIRE(part->size() == 4);  // 3, 5, 7, 9
  CHECK(part->info().times[1] == 0.5);
  const FrameImages images = part->read(2);
  CHECK(images.frame_index == 2);
  CHECK(images.time == 0.7);
  CHECK(holds(images.right, picture_of(7, 1)));
  CHECK(part_of_sequence(open_rectified(footage), 3, 2, 2)->size() == 2);
  CHECK(part_of_sequence(open_rectified(footage), 9, 5)->size() == 1);
  check_holds(complaint([&] { part_of_sequence(open_rectified(footage), 10, 1); }),
              "left: has 10 frames; there is no frame 10 to start with");
}

}  // namespace hybrid_slam
