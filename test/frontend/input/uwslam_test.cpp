#include <catch2/catch.hpp>

#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 6;

std::string ros_camera(double p3) {
  return cv::format(
      "image_width: 60\nimage_height: 40\ncamera_name: x\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [80, 0, 31, 0, 80, 21, 0, 0, 1]\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n"
      "  data: [80.0, 0, 31, %.6f, 0, 80.0, 21, 0, 0, 0, 1, 0]\n",
      p3);
}

void write_calibration(const fs::path& folder) {
  write_text(folder / "left_camera.yaml", ros_camera(0));
  write_text(folder / "right_camera.yaml", ros_camera(-12));
}

// A camera at `position` that looks at `target`, turned about its axis by `roll`.
Rigid3d looking_at(const Eigen::Vector3d& position, const Eigen::Vector3d& target, double roll) {
  const Eigen::Quaterniond look = Eigen::Quaterniond::FromTwoVectors(
      Eigen::Vector3d::UnitZ(), Eigen::Vector3d(target - position));
  return {look * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()), position};
}

Rigid3d stereo_pose(int i) {
  return looking_at({0.05 * i, -1.3, 1.6}, {0.1, 0.02 * i, 0}, 0.05 * i);
}

Rigid3d fish_pose(int i) {
  return looking_at({0.5 - 0.2 * i, -0.3, 1.2 - 0.1 * i}, {0, 0.1, 0.05 * i}, 0.2 * i);
}

std::string pose_text(const Rigid3d& pose) {
  const auto q = pose.rotation();
  const auto t = pose.translation();
  return cv::format(" %.9f %.9f %.9f %.9f %.9f %.9f %.9f", t.x(), t.y(), t.z(), q.w(), q.x(), q.y(),
                    q.z());
}

std::string camera_poses(bool cam_from_world, const Rigid3d& file_from_world = {}) {
  std::string text;
  for (int i = 0; i < kFrames; ++i) {
    const auto written = [&](const Rigid3d& world_from_cam) {
      const Rigid3d file_from_cam = file_from_world * world_from_cam;
      return pose_text(cam_from_world ? inverse(file_from_cam) : file_from_cam);
    };
    if (i != 2) text += std::to_string(i) + written(fish_pose(i)) + written(stereo_pose(i)) + "\n";
  }
  return text;
}

void write_hybrid(const fs::path& root, const char* ending = ".png") {
  const fs::path folder = root / "hybrid" / "M1";
  std::string times;
  for (int i = 0; i < kFrames; ++i) {
    const std::string number = std::to_string(i);
    write_picture(folder / "images/raw" / (number + "_left" + ending), test_picture(60, 40, 2 * i));
    write_picture(folder / "images/raw" / (number + "_right" + ending),
                  test_picture(60, 40, 2 * i + 1));
    write_picture(folder / "images/raw" / (number + "_fish" + ending), test_picture(50, 50, 90));
    times += std::to_string(i / 3.0) + "\n";
  }
  write_text(folder / "times.txt", times);
  write_text(folder / "camera_poses.txt", camera_poses(false));
  write_calibration(root / "hybrid/calibration");
}

void write_stereo(const fs::path& root) {
  const fs::path folder = root / "stereo";
  std::string times, positions;
  for (int i = 0; i < kFrames; ++i) {
    for (int side = 0; side < 2; ++side) {
      write_picture(folder / "images" / (std::to_string(i) + "_" + std::to_string(side) + ".png"),
                    test_picture(60, 40, 2 * i + side));
    }
    times += std::to_string(100 + 0.2 * i) + "\n";
    positions += std::to_string(100 + 0.2 * i) + " " + std::to_string(i) + " 5 6\n";
  }
  write_text(folder / "time.txt", times);
  write_text(folder / "gt_poses.txt", positions);
  write_calibration(folder / "calibration");
}

TEST_CASE("the hybrid layout opens from the root, its hybrid folder and the sequence") {
  const TempFolder folder;
  write_hybrid(folder.path());
  for (const auto& [path, name] :
       {std::pair(folder.path(), "M1"), std::pair(folder.path(), ""),
        std::pair(folder.path() / "hybrid", "M1"), std::pair(folder.path() / "hybrid/M1", ""),
        std::pair(folder.path() / "hybrid/M1/", "M1")}) {
    const auto sequence = open_sequence(path.string(), SequenceLayout::kAuto, name);
    const SequenceInfo& info = sequence->info();
    CHECK(info.name == "M1");
    CHECK(info.layout == "uwslam");
    CHECK(info.warnings.empty());
    CHECK(sequence->size() == kFrames);
    CHECK(info.stereo.params == std::array<double, 5>{80, 80, 31, 21, 0.15});
    CHECK(info.times[4] == Approx(4 / 3.0).margin(1e-6));
    CHECK(holds(sequence->read(3).left, test_picture(60, 40, 6)));
    CHECK(holds(sequence->read(3).right, test_picture(60, 40, 7)));
    REQUIRE(info.truth.size() == kFrames - 1);
    CHECK(info.truth[2].time == info.times[3]);  // there is no truth for image 2
    const Rigid3d error = inverse(info.truth[2].world_from_cam) * stereo_pose(3);
    CHECK(error.translation().norm() < 1e-6);
    CHECK(Eigen::Quaterniond(error.rotation()).vec().norm() < 1e-6);
  }
}

TEST_CASE("the hybrid layout reads .jpg too") {
  const TempFolder folder;
  write_hybrid(folder.path(), ".jpg");
  CHECK(open_sequence(folder.path().string(), SequenceLayout::kUwslam, "M1")->read(2).left.width ==
        60);
}

TEST_CASE("the stereo layout opens, with positions as truth") {
  const TempFolder folder;
  write_stereo(folder.path());
  for (const auto& [path, name] : {std::pair(folder.path(), "stereo"), std::pair(folder.path(), ""),
                                   std::pair(folder.path() / "stereo", "")}) {
    const auto sequence = open_sequence(path.string(), SequenceLayout::kAuto, name);
    const SequenceInfo& info = sequence->info();
    CHECK(info.name == "stereo");
    CHECK(sequence->size() == kFrames);
    CHECK(holds(sequence->read(5).right, test_picture(60, 40, 11)));
    REQUIRE(info.truth.size() == kFrames);
    CHECK_FALSE(info.truth_has_rotation);
    CHECK(info.truth[3].time == Approx(100.6));
    CHECK(info.truth[3].world_from_cam.translation() == Eigen::Vector3d(3, 5, 6));
  }
  write_text(folder.path() / "stereo/gt_poses.txt", "0 5 6\n1 5 6\n2 5 6\n3 5 6\n4 5 6\n5 5 6\n");
  const auto older = open_sequence(folder.path().string(), SequenceLayout::kAuto, "stereo");
  REQUIRE(older->info().truth.size() == kFrames);
  CHECK(older->info().truth[3].time == Approx(100.6));
  CHECK(older->info().truth[3].world_from_cam.translation() == Eigen::Vector3d(3, 5, 6));
}

TEST_CASE("the convention of camera_poses.txt is found or told") {
  const TempFolder folder;
  write_hybrid(folder.path());
  const fs::path file = folder.path() / "hybrid/M1/camera_poses.txt";
  const auto first_truth = [&](TruthConvention convention, const char* expected) {
    const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "M1",
                                        SequenceCameras::kStereo, convention);
    CHECK(sequence->info().truth_convention == expected);
    return Eigen::Vector3d(sequence->info().truth[0].world_from_cam.translation());
  };
  const Eigen::Vector3d position = stereo_pose(0).translation();
  const Eigen::Vector3d inverted = inverse(stereo_pose(0)).translation();
  for (const bool cam_from_world : {false, true}) {
    write_text(file, camera_poses(cam_from_world));
    const char* const meant = cam_from_world ? "cam_from_world" : "world_from_cam";
    CHECK((first_truth(TruthConvention::kAuto, meant) - position).norm() < 1e-6);
  }
  // A world that is the camera's first pose: nothing tells, so the description is believed.
  for (const bool cam_from_world : {false, true}) {
    write_text(file, camera_poses(cam_from_world, inverse(stereo_pose(0))));
    CHECK(first_truth(TruthConvention::kAuto, "world_from_cam").norm() < 1e-6);
    CHECK(open_sequence(folder.path().string(), SequenceLayout::kAuto, "M1")
              ->info()
              .warnings.size() == 1);
  }
  write_text(file, camera_poses(true));
  CHECK((first_truth(TruthConvention::kCamFromWorld, "cam_from_world") - position).norm() < 1e-6);
  CHECK((first_truth(TruthConvention::kWorldFromCam, "world_from_cam") - inverted).norm() < 1e-6);
}

TEST_CASE("UWslam's truth as its own scripts take it") {
  const TempFolder folder;
  write_stereo(folder.path());
  write_text(folder.path() / "stereo/gt_poses.txt",
             "1403636579000000000,1,5,6\n1403636579200000000,2,5,6\n");
  const auto positions = open_sequence(folder.path().string(), SequenceLayout::kAuto, "stereo");
  REQUIRE(positions->info().truth.size() == 2);
  CHECK(positions->info().truth[1].time == Approx(1403636579.2).epsilon(1e-12));
  REQUIRE(!positions->info().warnings.empty());
  CHECK(positions->info().warnings[0].find("times read as nanoseconds") != std::string::npos);

  const TempFolder hybrid;
  write_hybrid(hybrid.path());
  write_text(hybrid.path() / "hybrid/M1/camera_poses.txt",
             "1,1,2,3,1,0,0,0\n3,4,5,6,0.6,0.8,0,0\n");
  const auto handles = open_sequence(hybrid.path().string(), SequenceLayout::kAuto, "M1");
  const SequenceInfo& info = handles->info();
  CHECK(info.truth.empty());
  REQUIRE(info.fisheye_truth.size() == 2);
  CHECK(info.fisheye_truth[1].time == info.times[3]);
  CHECK(info.fisheye_truth[1].world_from_cam.translation() == Eigen::Vector3d(4, 5, 6));
  CHECK(info.fisheye_truth[1].world_from_cam.rotation().x() == Approx(0.8));
  REQUIRE(info.warnings.size() == 1);
  CHECK(info.warnings[0].find("poses of the fisheye alone") != std::string::npos);
}

TEST_CASE("a wide baseline and slow times are doubted") {
  const TempFolder folder;
  write_hybrid(folder.path());
  for (const char* const name : {"left_camera.yaml", "right_camera.yaml"}) {
    const double p3 = std::string(name) == "left_camera.yaml" ? 0 : -12000;  // 150 m at f = 80
    write_text(folder.path() / "hybrid/calibration" / name, ros_camera(p3));
  }
  std::string times;
  for (int i = 0; i < kFrames; ++i) times += std::to_string(333333333LL * i) + "\n";
  write_text(folder.path() / "hybrid/M1/times.txt", times);
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "M1");
  const std::vector<std::string>& warnings = sequence->info().warnings;
  REQUIRE(warnings.size() == 2);
  CHECK(warnings[0].find("the baseline is 150 m: is the calibration in millimetres?") !=
        std::string::npos);
  CHECK(warnings[1].find("frames are 3.33333e+08 s apart") != std::string::npos);
}

TEST_CASE("a UWslam dataset that cannot be used is refused with one line") {
  const TempFolder folder;
  write_hybrid(folder.path());
  const fs::path sequence = folder.path() / "hybrid/M1";
  const fs::path calibration = folder.path() / "hybrid/calibration";
  std::string expected;

  SECTION("calibration files exchanged") {
    write_text(calibration / "left_camera.yaml", ros_camera(-12));
    write_text(calibration / "right_camera.yaml", ros_camera(0));
    expected = "left and right files are swapped";
  }
  SECTION("calibration missing") {
    fs::remove(calibration / "right_camera.yaml");
    expected = "right_camera.yaml";
  }
  SECTION("calibration not finite") {
    replace_text(calibration / "left_camera.yaml", "data: [80.0", "data: [.nan");
    expected = "left_camera.yaml:20: projection_matrix.data: is not finite";
  }
  SECTION("calibration negative") {
    for (const char* const name : {"left_camera.yaml", "right_camera.yaml"}) {
      replace_text(calibration / name, "data: [80.0", "data: [-80.0");
    }
    expected = "left_camera.yaml:18: projection_matrix: the focal length must be positive";
  }
  SECTION("not a rectified pair") {
    replace_text(calibration / "left_camera.yaml", "0, 80.0, 21", "0, 80.0, 25");
    expected = "the pair is not rectified";
  }
  SECTION("calibration of another size") {
    for (const char* const name : {"left_camera.yaml", "right_camera.yaml"}) {
      replace_text(calibration / name, "image_width: 60", "image_width: 120");
    }
    expected = "calibrated for 120x40, but the images are 60x40";
  }
  SECTION("no right images") {
    for (int i = 0; i < kFrames; ++i) {
      fs::remove(sequence / "images/raw" / (std::to_string(i) + "_right.png"));
    }
    expected = "holds no images <number>_right";
  }
  SECTION("no images") {
    fs::remove_all(sequence / "images/raw");
    fs::create_directory(sequence / "images/raw");
    expected = "holds no images";
  }
  SECTION("times out of order") {
    write_text(sequence / "times.txt", "0\n1\n1\n2\n3\n4\n");
    expected = "times.txt:3: times are not strictly ascending";
  }
  SECTION("no times") {
    fs::remove(sequence / "times.txt");
    expected = "times.txt: no such file";
  }
  SECTION("fewer times than images") {
    write_text(sequence / "times.txt", "0\n1\n");
    expected = "has 2 times, but there are images up to number 5";
  }
  SECTION("truth with 14 columns") {
    replace_text(sequence / "camera_poses.txt", "0 ", "");
    expected = "camera_poses.txt:1: expected 15 numbers, found 14";
  }
  SECTION("truth of an image that has no time") {
    replace_text(sequence / "camera_poses.txt", "\n5 ", "\n6 ");
    expected = "camera_poses.txt:5: no time belongs to this index";
  }
  SECTION("truth out of order") {
    replace_text(sequence / "camera_poses.txt", "\n4 ", "\n3 ");
    expected = "camera_poses.txt:4: indices are not strictly ascending";
  }
  const std::string line = open_complaint(folder.path());
  INFO(expected << "\n" << line);
  CHECK(line.find(expected) != std::string::npos);
}

const char* const kFisheyeCalibration =
    "%YAML:1.0\n---\nimage_width: 50\nimage_height: 50\nfx: 15\nfy: 15\ncx: 25\ncy: 24\n"
    "k1: 0.01\nk2: 0\nk3: 0\nk4: 0\n";

std::unique_ptr<ImageSequence> open_hybrid(const fs::path& root, SequenceCameras cameras) {
  return open_sequence(root.string(), SequenceLayout::kAuto, "M1", cameras);
}

TEST_CASE("the fisheye comes along when it is wanted") {
  const TempFolder folder;
  write_hybrid(folder.path());
  const fs::path calibration = folder.path() / "hybrid/calibration/fisheye_calib.yaml";
  write_text(calibration, kFisheyeCalibration);
  for (const SequenceCameras cameras : {SequenceCameras::kHybrid, SequenceCameras::kAuto}) {
    const auto sequence = open_hybrid(folder.path(), cameras);
    CHECK(sequence->info().warnings.empty());
    REQUIRE(sequence->info().fisheye);
    CHECK(sequence->info().fisheye->params[3] == 24);
    CHECK(holds(sequence->read(3).fisheye, test_picture(50, 50, 90)));
    const auto& truth = sequence->info().fisheye_truth;
    REQUIRE(truth.size() == sequence->info().truth.size());
    CHECK(truth[3].time == Approx(4 / 3.0));
    CHECK(truth[3].world_from_cam.translation().isApprox(fish_pose(4).translation(), 1e-8));
  }
  const auto stereo = open_hybrid(folder.path(), SequenceCameras::kStereo);
  CHECK_FALSE(stereo->info().fisheye);
  CHECK(stereo->read(3).fisheye.empty());
}

TEST_CASE("fisheye images may be missing for a while or altogether") {
  const TempFolder folder;
  write_hybrid(folder.path());
  write_text(folder.path() / "hybrid/calibration/fisheye_calib.yaml", kFisheyeCalibration);
  const fs::path images = folder.path() / "hybrid/M1/images/raw";
  fs::remove(images / "2_fish.png");
  truncate_file(images / "3_fish.png");
  const auto sequence = open_hybrid(folder.path(), SequenceCameras::kHybrid);
  REQUIRE(sequence->info().warnings.size() == 1);
  CHECK(sequence->info().warnings[0].find("1 of 6 frames lack a fisheye image") !=
        std::string::npos);
  CHECK(sequence->read(2).fisheye.empty());
  CHECK(sequence->read(2).fisheye_error.find("frame 2: no fisheye image") != std::string::npos);
  CHECK(sequence->read(3).fisheye_error.find("3_fish.png") != std::string::npos);
  CHECK(sequence->read(3).left.width == 60);
  CHECK(sequence->read(4).fisheye_error.empty());
  for (int i = 0; i < kFrames; ++i) fs::remove(images / (std::to_string(i) + "_fish.png"));
  const auto none = open_hybrid(folder.path(), SequenceCameras::kHybrid);
  CHECK_FALSE(none->info().fisheye);
  REQUIRE(none->info().warnings.size() == 1);
  CHECK(none->info().warnings[0].find("holds no fisheye images") != std::string::npos);
  CHECK(open_hybrid(folder.path(), SequenceCameras::kAuto)->info().warnings.empty());
}

TEST_CASE("a fisheye calibration that cannot be used is refused, unless it is not needed") {
  const TempFolder folder;
  write_hybrid(folder.path());
  const fs::path calibration = folder.path() / "hybrid/calibration/fisheye_calib.yaml";
  const auto refused = [&](const std::string& from, const std::string& to,
                           const std::string& reason) {
    write_text(calibration, kFisheyeCalibration);
    replace_text(calibration, from, to);
    const std::string line =
        complaint([&] { open_hybrid(folder.path(), SequenceCameras::kHybrid); });
    INFO(line);
    CHECK(line.find("fisheye_calib.yaml") != std::string::npos);
    CHECK(line.find(reason) != std::string::npos);
    CHECK_NOTHROW(open_hybrid(folder.path(), SequenceCameras::kStereo));
  };
  refused("fx: 15", "fx: .nan", "fx");
  refused("k2: 0", "k2: -2", "folds at 32 degrees");
  refused("image_width: 50", "image_width: 60", "the images are 50x50");
  fs::remove(calibration);
  CHECK(complaint([&] {
          open_hybrid(folder.path(), SequenceCameras::kHybrid);
        }).find("fisheye_calib.yaml") != std::string::npos);
}

}  // namespace
}  // namespace hybrid_slam
