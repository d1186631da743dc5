#include <catch2/catch.hpp>

#include "frontend/input/pose_rows.h"
#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 8;
const char* const kCalibration =
    "P0: 700 0 30 0 0 700 20 0 0 0 1 0\nP1: 700 0 30 -350 0 700 20 0 0 0 1 0\n";

fs::path image(const fs::path& root, int side, int number, const char* ending = ".png") {
  char name[16];
  std::snprintf(name, sizeof(name), "%06d", number);
  return root / "sequences" / "07" / (side == 0 ? "image_0" : "image_1") /
         (std::string(name) + ending);
}

void write_kitti(const fs::path& root, bool with_truth = true) {
  std::string times, poses;
  for (int i = 0; i < kFrames; ++i) {
    for (int side = 0; side < 2; ++side) {
      write_picture(image(root, side, i), test_picture(60, 40, 2 * i + side));
    }
    times += std::to_string(0.5 * i) + "\n";
    poses += "0 -1 0 " + std::to_string(i) + " 1 0 0 2 0 0 1 3\n";  // 90 degrees about z
  }
  write_text(root / "sequences/07/calib.txt", kCalibration);
  write_text(root / "sequences/07/times.txt", times);
  if (with_truth) write_text(root / "poses/07.txt", poses);
}

TEST_CASE("a KITTI dataset opens from its root, its sequences and the sequence") {
  const TempFolder folder;
  write_kitti(folder.path());
  const fs::path root = folder.path();
  for (const auto& [path, name] :
       {std::pair(root, "07"), std::pair(root, ""), std::pair(root / "sequences", "07"),
        std::pair(root / "sequences/07", ""), std::pair(root / "sequences/07/", "07")}) {
    const auto sequence = open_sequence(path.string(), SequenceLayout::kAuto, name);
    const SequenceInfo& info = sequence->info();
    CHECK(info.layout == "kitti");
    CHECK(info.name == "07");
    CHECK(info.warnings.empty());
    CHECK(sequence->size() == kFrames);
    CHECK(info.times[3] == Approx(1.5));
    CHECK(info.stereo.params == std::array<double, 5>{700, 700, 30, 20, 0.5});
    CHECK(info.stereo.width == 60);
    CHECK(info.stereo.height == 40);
    REQUIRE(info.truth.size() == kFrames);
    CHECK(info.truth_has_rotation);
    CHECK(info.truth[4].time == Approx(2));
    const Eigen::Vector3d moved = info.truth[4].world_from_cam * Eigen::Vector3d(1, 0, 0);
    CHECK((moved - Eigen::Vector3d(4, 3, 3)).norm() < 1e-12);
    const FrameImages images = sequence->read(5);
    CHECK(images.frame_index == 5);
    CHECK(images.time == Approx(2.5));
    CHECK(holds(images.left, test_picture(60, 40, 10)));
    CHECK(holds(images.right, test_picture(60, 40, 11)));
  }
}

TEST_CASE("KITTI's files with byte order marks and Windows line ends, and in UTF-16") {
  const TempFolder folder;
  write_kitti(folder.path());
  const fs::path sequence = folder.path() / "sequences/07";
  const fs::path files[] = {sequence / "calib.txt", sequence / "times.txt",
                            folder.path() / "poses/07.txt"};
  for (const fs::path& file : files) {
    std::string marked = "\xEF\xBB\xBF";
    for (const char c : read_text(file)) marked += c == '\n' ? "\r\n" : std::string(1, c);
    write_text(file, marked);
  }
  const auto opened = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  const SequenceInfo& info = opened->info();
  CHECK(info.warnings.empty());
  CHECK(info.stereo.params == std::array<double, 5>{700, 700, 30, 20, 0.5});
  CHECK(info.times[3] == 1.5);
  CHECK(info.truth[4].world_from_cam.translation() == Eigen::Vector3d(4, 2, 3));
  for (const fs::path& file : files) {
    const std::string good = read_text(file);
    std::string wide = "\xFF\xFE";
    for (const char c : good.substr(3)) (wide += c) += '\0';
    write_text(file, wide);
    const std::string line = open_complaint(folder.path());
    INFO(line);
    CHECK(line.starts_with(file.string()));
    CHECK(line.find("UTF-16") != std::string::npos);
    write_text(file, good);
  }
}

TEST_CASE("a KITTI sequence without truth, and one with less truth than frames") {
  const TempFolder folder;
  write_kitti(folder.path(), false);
  CHECK(open_sequence(folder.path().string(), SequenceLayout::kKitti, "")->info().truth.empty());
  write_text(folder.path() / "poses/07.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kKitti, "");
  CHECK(sequence->info().truth.size() == 1);
  CHECK(sequence->info().warnings.size() == 1);
}

TEST_CASE("single missing images make corrupt frames, a cut copy a shorter sequence") {
  const TempFolder folder;
  write_kitti(folder.path());
  fs::remove(image(folder.path(), 1, 3));
  fs::remove(image(folder.path(), 0, 5));
  fs::remove(image(folder.path(), 0, 7));
  fs::remove(image(folder.path(), 1, 7));
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "07");
  CHECK(sequence->size() == 7);
  CHECK(sequence->info().truth.size() == 7);
  CHECK(sequence->info().warnings.size() == 2);
  for (std::size_t i = 0; i < sequence->size(); ++i) {
    const std::string line = complaint([&] { sequence->read(i); });
    const std::string expected = i == 3 ? "no right image" : i == 5 ? "no left image" : "";
    CHECK((expected.empty() ? line.empty() : line.find(expected) != std::string::npos));
  }
}

TEST_CASE("a sequence that starts in the middle keeps its times and truth") {
  const TempFolder folder;
  write_kitti(folder.path());
  for (int i = 0; i < 2; ++i) {
    fs::remove(image(folder.path(), 0, i));
    fs::remove(image(folder.path(), 1, i));
  }
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "07");
  REQUIRE(sequence->size() == 6);
  CHECK(sequence->info().times[0] == Approx(1));
  CHECK(sequence->info().truth[0].world_from_cam.translation().x() == Approx(2));
  CHECK(holds(sequence->read(0).left, test_picture(60, 40, 4)));
}

TEST_CASE("damaged images fail when read, and only those") {
  const TempFolder folder;
  write_kitti(folder.path());
  truncate_file(image(folder.path(), 0, 0));
  truncate_file(image(folder.path(), 1, 4));
  write_picture(image(folder.path(), 1, 6), test_picture(61, 40, 0));
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "07");
  CHECK(sequence->info().warnings.empty());
  for (std::size_t i = 0; i < sequence->size(); ++i) {
    const std::string line = complaint([&] { sequence->read(i); });
    CHECK(line.empty() == (i != 0 && i != 4 && i != 6));
  }
}

TEST_CASE("a KITTI dataset that cannot be used is refused with one line") {
  const TempFolder folder;
  write_kitti(folder.path());
  const fs::path sequence = folder.path() / "sequences/07";
  std::string expected;
  std::string name = "07";

  SECTION("no right folder") {
    fs::remove_all(sequence / "image_1");
    expected = "image_1: no such folder";
  }
  SECTION("empty right folder") {
    fs::remove_all(sequence / "image_1");
    fs::create_directory(sequence / "image_1");
    expected = "image_1: holds no images";
  }
  SECTION("most right images missing") {
    for (int i = 2; i < kFrames; ++i) fs::remove(image(folder.path(), 1, i));
    expected = "6 of 8 frames lack an image";
  }
  SECTION("more images than times") {
    write_text(sequence / "times.txt", "0\n1\n2\n3\n4\n");
    expected = "has 5 times, but there are images up to number 7";
  }
  SECTION("times out of order") {
    write_text(sequence / "times.txt", "0\n1\n2\n4\n3\n5\n6\n7\n");
    expected = "times.txt:5: times are not strictly ascending";
  }
  SECTION("a time is not a number") {
    write_text(sequence / "times.txt", "0\n1\nnan\n4\n5\n6\n7\n8\n");
    expected = "times.txt:3: \"nan\" is not finite";
  }
  SECTION("no times") {
    fs::remove(sequence / "times.txt");
    expected = "times.txt: no such file";
  }
  SECTION("no calibration") {
    fs::remove(sequence / "calib.txt");
    expected = "calib.txt: no such file";
  }
  SECTION("calibration of one camera") {
    write_text(sequence / "calib.txt", "P0: 700 0 30 0 0 700 20 0 0 0 1 0\n");
    expected = "calib.txt: no line \"P1:\"";
  }
  SECTION("short calibration") {
    replace_text(sequence / "calib.txt", "-350 0 700", "-350 700");
    expected = "calib.txt:2: P1: expected 12 numbers";
  }
  SECTION("calibration not a number") {
    replace_text(sequence / "calib.txt", "P0: 700", "P0: nan");
    expected = "calib.txt:1: \"nan\" is not finite";
  }
  SECTION("calibration exchanged") {
    write_text(sequence / "calib.txt",
               "P1: 700 0 30 0 0 700 20 0 0 0 1 0\nP0: 700 0 30 -350 0 700 20 0 0 0 1 0\n");
    expected = "calib.txt: the baseline is not positive";
  }
  SECTION("no baseline") {
    replace_text(sequence / "calib.txt", "-350", "0");
    expected = "calib.txt: the baseline is not positive";
  }
  SECTION("negative focal length") {
    write_text(sequence / "calib.txt",
               "P0: -7 0 30 0 0 -7 20 0 0 0 1 0\nP1: -7 0 30 -350 0 -7 20 0 0 0 1 0\n");
    expected = "calib.txt: the focal length is not positive";
  }
  SECTION("two focal lengths") {
    replace_text(sequence / "calib.txt", "P1: 700", "P1: 710");
    expected = "not those of a rectified pair";
  }
  SECTION("principal point outside") {
    write_text(sequence / "calib.txt",
               "P0: 700 0 300 0 0 700 20 0 0 0 1 0\nP1: 700 0 300 -350 0 700 20 0 0 0 1 0\n");
    expected = "calib.txt: the principal point lies outside the image";
  }
  SECTION("truth not finite") {
    replace_text(folder.path() / "poses/07.txt", "0 -1 0 3", "0 -1 0 inf");
    expected = "07.txt:4: \"inf\" is not finite";
  }
  SECTION("truth not a rotation") {
    replace_text(folder.path() / "poses/07.txt", "0 -1 0 3", "0 -2 0 3");
    expected = "07.txt:4: the 3x3 part is not a rotation";
  }
  SECTION("two images of one number") {
    write_picture(image(folder.path(), 0, 2, ".jpg"), test_picture(60, 40, 2));
    expected = "same number";
  }
  SECTION("every left image broken") {
    for (int i = 0; i < kFrames; ++i) truncate_file(image(folder.path(), 0, i));
    expected = "000000.png: truncated PNG";
  }
  SECTION("another name") {
    name = "08";
    expected = "no sequence \"08\"; there is: 07";
  }
  INFO(expected);
  const std::string line = open_complaint(folder.path(), name);
  INFO(line);
  CHECK(line.find(expected) != std::string::npos);
}

TEST_CASE("white is found over the sequence, and darkness is said") {
  const TempFolder folder;
  write_kitti(folder.path());
  const fs::path sequence = folder.path() / "sequences/07";
  const auto rewrite = [&](int factor, int divisor) {
    for (const auto& entry : fs::recursive_directory_iterator(sequence)) {
      if (entry.path().extension() != ".png") continue;
      cv::Mat wide;
      const cv::Mat picture = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
      picture.convertTo(wide, CV_16UC1, static_cast<double>(factor) / divisor);
      write_picture(entry.path(), wide);
    }
  };
  const GrayImage plain =
      open_sequence(folder.path().string(), SequenceLayout::kAuto, "")->read(1).left;
  rewrite(16, 1);
  const auto twelve = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  REQUIRE(twelve->info().warnings.size() == 1);
  CHECK(twelve->info().warnings[0].find("4095 is taken for white") != std::string::npos);
  CHECK(twelve->read(1).left.pixels == plain.pixels);
  InputOptions options;
  options.images.white = 65535;
  const auto dark = open_sequence(folder.path().string(), SequenceLayout::kAuto, "",
                                  SequenceCameras::kStereo, TruthConvention::kAuto, options);
  REQUIRE(dark->info().warnings.size() == 1);
  CHECK(dark->info().warnings[0].find("the left images are dark: mean brightness 7") !=
        std::string::npos);
  rewrite(0, 1);
  const auto black = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  CHECK(black->info().warnings.back().find("the left images are black") != std::string::npos);
}

TEST_CASE("KITTI's colour images, with truth of their own camera") {
  const TempFolder folder;
  write_kitti(folder.path());
  const fs::path sequence = folder.path() / "sequences/07";
  const auto grey = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  const FrameImages images = grey->read(1);
  fs::rename(sequence / "image_0", sequence / "image_2");
  fs::rename(sequence / "image_1", sequence / "image_3");
  const auto& [fx, fy, cx, cy, baseline] = grey->info().stereo.params;
  // As in KITTI's own files: 0.06 m left of camera 0, and a few mm up and ahead.
  const Eigen::Vector3d t(0.06, -0.001, 0.003);
  std::string text = read_text(sequence / "calib.txt");
  for (const int camera : {2, 3}) {
    const double x = t.x() - (camera == 3 ? baseline : 0);
    text += cv::format("P%d: %.9f 0 %.9f %.9f 0 %.9f %.9f %.9f 0 0 1 %.9f\n", camera, fx, cx,
                       fx * x + cx * t.z(), fy, cy, fy * t.y() + cy * t.z(), t.z());
  }
  write_text(sequence / "calib.txt", text);
  const auto colour = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  CHECK(colour->info().stereo.params[4] == Approx(baseline));
  CHECK(colour->read(1).left.pixels == images.left.pixels);
  CHECK(colour->read(1).right.pixels == images.right.pixels);
  REQUIRE(colour->info().truth.size() == grey->info().truth.size());
  const Rigid3d cam0_from_left =
      inverse(grey->info().truth[1].world_from_cam) * colour->info().truth[1].world_from_cam;
  CHECK((cam0_from_left.translation() + t).norm() < 1e-6);
}

// A drive of two frames of KITTI raw, or of KITTI-360 below `root`.
void write_drive(const fs::path& drive, const char* data) {
  for (int side = 0; side < 2; ++side) {
    const fs::path camera = drive / (side == 0 ? "image_00" : "image_01");
    for (int i = 0; i < 2; ++i) {
      write_picture(camera / data / (i == 0 ? "0000000000.png" : "0000000001.png"),
                    test_picture(60, 40, 2 * i + side));
    }
    write_text(camera / "timestamps.txt",
               "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.067689445\n");
  }
}

const char* const kRawCalibration =
    "calib_time: 09-Jan-2012 13:57:47\nR_rect_00: 1 0 0 0 1 0 0 0 1\n"
    "P_rect_00: 700 0 30 0 0 700 20 0 0 0 1 0\nP_rect_01: 700 0 30 -350 0 700 20 0 0 0 1 0\n";

TEST_CASE("one channel of a sequence's colour images is taken for grey") {
  const TempFolder folder;
  write_kitti(folder.path());
  for (const auto& entry : fs::recursive_directory_iterator(folder.path() / "sequences/07")) {
    if (entry.path().extension() != ".png") continue;
    const cv::Mat picture = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    // Red is dead, as under water; green and blue differ.
    const std::array<cv::Mat, 3> blue_green_red{255 - picture, picture, 0 * picture};
    cv::Mat colour;
    cv::merge(blue_green_red.data(), 3, colour);
    write_picture(entry.path(), colour);
  }
  const auto open = [&](GrayChannel channel) {
    InputOptions options;
    options.images.channel = channel;
    return open_sequence(folder.path().string(), SequenceLayout::kAuto, "",
                         SequenceCameras::kStereo, TruthConvention::kAuto, options);
  };
  const cv::Mat left = test_picture(60, 40, 2), right = test_picture(60, 40, 3);
  CHECK(holds(open(GrayChannel::kGreen)->read(1).left, left));
  CHECK(holds(open(GrayChannel::kGreen)->read(1).right, right));
  CHECK(holds(open(GrayChannel::kBlue)->read(1).left, 255 - left));
  const auto red = open(GrayChannel::kRed);
  CHECK(holds(red->read(1).left, 0 * left));
  REQUIRE(red->info().warnings.size() == 1);
  CHECK(red->info().warnings[0].find("the left images are black") != std::string::npos);
  CHECK(open(GrayChannel::kGrey)->info().warnings.empty());
}

TEST_CASE("KITTI raw opens, with truth from its GPS and IMU") {
  const TempFolder folder;
  const fs::path date = folder.path() / "2011_09_26", drive = date / "2011_09_26_drive_0001_sync";
  write_drive(drive, "data");
  write_text(date / "calib_cam_to_cam.txt", kRawCalibration);
  // The camera looks along the IMU's x (forward), its x is the IMU's -y, 0.5 m ahead of the IMU.
  write_text(date / "calib_velo_to_cam.txt", "R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 -0.5\n");
  write_text(date / "calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n");
  // North-east by some metres, heading north (yaw 90 degrees).
  write_text(drive / "oxts/data/0000000000.txt", "49.0 8.4 112 0 0 1.5707963267948966 0 0\n");
  write_text(drive / "oxts/data/0000000001.txt",
             "49.00002 8.40001 113 0 0 1.5707963267948966 0 0\n");
  for (const fs::path& path : {drive, date}) {
    const auto sequence = open_sequence(path.string(), SequenceLayout::kAuto, "");
    const SequenceInfo& info = sequence->info();
    CHECK(info.layout == "kitti");
    CHECK(info.warnings.empty());
    CHECK(info.stereo.params == std::array<double, 5>{700, 700, 30, 20, 0.5});
    CHECK(info.times[0] == Approx(1317042145.964389445).epsilon(1e-15));
    CHECK(info.times[1] - info.times[0] == Approx(0.1033).epsilon(1e-5));
    CHECK(holds(sequence->read(1).right, test_picture(60, 40, 3)));
    REQUIRE(info.truth.size() == 2);
    const Eigen::Vector3d moved =
        info.truth[1].world_from_cam.translation() - info.truth[0].world_from_cam.translation();
    const double degree = 6378137 * M_PI / 180;  // [m] of latitude
    CHECK(moved.x() == Approx(1e-5 * degree * std::cos(49 * M_PI / 180)).epsilon(1e-4));
    CHECK(moved.y() == Approx(2e-5 * degree).epsilon(1e-4));
    CHECK(moved.z() == Approx(1));
    // Ahead of the camera is north, and the camera is 0.5 m north of the IMU.
    const Rigid3d& first = info.truth[0].world_from_cam;
    CHECK((first.rotation() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm() < 1e-9);
    CHECK((first.translation() - Eigen::Vector3d(0, 0.5, 0)).norm() < 1e-9);
  }
  write_text(drive / "image_00/timestamps.txt", "2011-13-26 13:02:25.9\n");
  CHECK(open_complaint(drive).find("timestamps.txt:1: no such day") != std::string::npos);
  write_text(drive / "image_00/timestamps.txt", "25.9\n26.0\n");
  CHECK(open_complaint(drive).find("timestamps.txt:1: expected a time such as") !=
        std::string::npos);
}

TEST_CASE("KITTI-360's perspective images open, with truth") {
  const TempFolder folder;
  const fs::path drive = folder.path() / "data_2d_raw/2013_05_28_drive_0000_sync";
  write_drive(drive, "data_rect");
  write_text(folder.path() / "calibration/perspective.txt", kRawCalibration);
  write_text(folder.path() / "data_poses/2013_05_28_drive_0000_sync/cam0_to_world.txt",
             "1 0 -1 0 7 1 0 0 8 0 0 1 9 0 0 0 1\n");
  for (const fs::path& path : {folder.path(), drive}) {
    const auto sequence = open_sequence(path.string(), SequenceLayout::kAuto, "");
    REQUIRE(sequence->info().truth.size() == 1);
    CHECK(sequence->info().truth[0].time == sequence->info().times[1]);
    CHECK(sequence->info().truth[0].world_from_cam.translation() == Eigen::Vector3d(7, 8, 9));
    CHECK(holds(sequence->read(0).left, test_picture(60, 40, 0)));
  }
}

TEST_CASE("a folder in no layout is refused") {
  const TempFolder folder;
  CHECK(open_complaint(folder.path()).find("no sequence in a known layout") != std::string::npos);
  CHECK(open_complaint(folder.path() / "x").find("no such folder") != std::string::npos);
  write_kitti(folder.path());
  CHECK(open_complaint(folder.path(), "", SequenceLayout::kEuroc).find("no EuRoC sequence") !=
        std::string::npos);
  CHECK(open_complaint(folder.path(), "", SequenceLayout::kUwslam).find("no UWslam sequence") !=
        std::string::npos);
}

TEST_CASE("the first of several sequences is taken with a warning") {
  const TempFolder folder;
  write_kitti(folder.path());
  fs::copy(folder.path() / "sequences/07", folder.path() / "sequences/03",
           fs::copy_options::recursive);
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  CHECK(sequence->info().name == "03");
  REQUIRE(sequence->info().warnings.size() == 1);
  CHECK(sequence->info().warnings[0].find("03, 07") != std::string::npos);
}

}  // namespace
}  // namespace hybrid_slam
