#include <array>

#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 96;
constexpr int kHeight = 64;
constexpr int kFrames = 4;
constexpr const char* kRecording = "recording_2020-10-07_14-47-51";

std::string frame_name(int frame) {
  return std::to_string(1602074877621449728 + frame * std::int64_t{33'333'333});
}

std::string seconds_of(int frame) {
  return frame_name(frame).substr(0, 10) + "." + frame_name(frame).substr(10);
}

void write_images(const fs::path& folder) {
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < kFrames; ++i) {
      write_picture(folder / ("cam" + std::to_string(side)) / (frame_name(i) + ".png"),
                    test_picture(kWidth, kHeight, 10 * i + side));
    }
  }
}

std::string matrix(double x) {
  return "1.0 0.0 0.0 " + std::to_string(x) +
         "\n0.0 1.0 0.0 0.0\n0.0 0.0 1.0 0.0\n0.0 0.0 0.0 1.0\n";
}

// As the dataset has it: one calibration for all recordings.
void write_four_seasons(const fs::path& root) {
  const fs::path recording = root / kRecording, calibration = root / "calibration";
  write_images(recording / "undistorted_images");
  write_images(recording / "distorted_images");
  std::string times = "# frame_id timestamp exposure\n";
  for (int i = 0; i < kFrames; ++i) times += frame_name(i) + " " + seconds_of(i) + " 2.5\n";
  write_text(recording / "times.txt", times);
  std::string poses =
      "# frame_id, translation (x y z), rotation quaternion (x y z w), scale, fusion_quality, v3\n";
  for (const int i : {1, 3}) {
    poses += frame_name(i) + "," + std::to_string(i) + ",0,2,0,0.6,0,0.8,0.5,0,0\n";
  }
  write_text(recording / "GNSSPoses.txt", poses);
  for (const char* const side : {"0", "1"}) {
    write_text(calibration / ("undistorted_calib_" + std::string(side) + ".txt"),
               "Pinhole 80.5 80.5 47.5 31.5 0.0 0.0 0.0 0.0\n96 64\ncrop\n96 64\n");
    write_text(calibration / ("calib_" + std::string(side) + ".txt"),
               "EquiDistant 80 80 47.5 31.5 0.01 -0.02 0.03 -0.01\n96 64\ncrop\n96 64\n");
  }
  write_text(calibration / "undistorted_calib_stereo.txt", matrix(-0.3004961618953472));
  write_text(calibration / "calib_stereo.txt", matrix(-0.3));
}

std::unique_ptr<ImageSequence> open(const fs::path& path, const std::string& name = "") {
  return open_sequence(path.string(), SequenceLayout::kAuto, name);
}

TEST_CASE("a 4Seasons recording opens from the root and its own folder") {
  const TempFolder folder;
  write_four_seasons(folder.path());
  for (const fs::path& path : {folder.path(), folder.path() / kRecording}) {
    const auto sequence = open(path, kRecording);
    const SequenceInfo& info = sequence->info();
    CHECK(info.layout == "4seasons");
    CHECK(info.name == kRecording);
    CHECK(info.warnings.empty());
    CHECK(info.stereo.params[0] == 80.5);
    CHECK(info.stereo.params[4] == Approx(0.3004961618953472).epsilon(1e-6));
    REQUIRE(sequence->size() == kFrames);
    CHECK(info.times[0] == Approx(1602074877.621449728).epsilon(1e-15));
    CHECK(info.times[3] - info.times[0] == Approx(0.1).margin(1e-6));
    const FrameImages images = sequence->read(2);  // as they are: rectified already
    CHECK(holds(images.left, test_picture(kWidth, kHeight, 20)));
    CHECK(holds(images.right, test_picture(kWidth, kHeight, 21)));
  }
}

TEST_CASE("4Seasons' truth is that of keyframes, scaled into metres") {
  const TempFolder folder;
  write_four_seasons(folder.path());
  const auto sequence = open(folder.path());
  const SequenceInfo& info = sequence->info();
  REQUIRE(info.truth.size() == 2);
  CHECK(info.truth_has_rotation);
  CHECK(info.truth[0].time == info.times[1]);
  CHECK(info.truth[1].time == info.times[3]);
  const Rigid3d& pose = info.truth[1].world_from_cam;
  CHECK((pose.translation() - Eigen::Vector3d(1.5, 0, 1)).norm() < 1e-12);
  CHECK(pose.rotation().y() == Approx(0.6));
  CHECK(pose.rotation().w() == Approx(0.8));
}

TEST_CASE("4Seasons' distorted images are rectified, by either of their calibrations") {
  const TempFolder folder;
  write_four_seasons(folder.path());
  const fs::path recording = folder.path() / kRecording;
  fs::remove_all(recording / "undistorted_images");
  const auto sequence = open(folder.path());
  CHECK(sequence->info().stereo.params[4] == Approx(0.3));
  CHECK(!holds(sequence->read(0).left, test_picture(kWidth, kHeight, 0)));
  // The truth is that of the undistorted images' camera, which may be turned against ours.
  CHECK(!sequence->info().truth_has_rotation);
  CHECK(sequence->info().truth.size() == 2);

  const std::string camera =
      "  camera_model: pinhole\n  distortion_model: equidistant\n"
      "  intrinsics: [80, 80, 47.5, 31.5]\n  distortion_coeffs: [0.01, -0.02, 0.03, -0.01]\n"
      "  resolution: [96, 64]\n";
  write_text(folder.path() / "calibration/camchain.yaml",
             "cam0:\n" + camera + "cam1:\n" + camera +
                 "  T_cn_cnm1: [[1, 0, 0, -0.3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n");
  fs::remove(folder.path() / "calibration/calib_0.txt");
  CHECK(open(folder.path())->read(0).left.pixels == sequence->read(0).left.pixels);
}

TEST_CASE("folders like 4Seasons' are read with what they have") {
  const TempFolder folder;
  write_four_seasons(folder.path());
  const fs::path recording = folder.path() / kRecording;
  SECTION("without times.txt frames are named by their times") {
    fs::remove(recording / "times.txt");
    const auto sequence = open(folder.path());
    REQUIRE(sequence->size() == kFrames);
    CHECK(sequence->info().times[1] == Approx(1602074877.654783061).epsilon(1e-15));
    CHECK(sequence->info().truth.size() == 2);
  }
  SECTION("frames with numbers, times with commas, calibration in the recording") {
    fs::rename(folder.path() / "calibration", recording / "Calibration");
    std::string times;
    for (int i = 0; i < kFrames; ++i) {
      times += std::to_string(i) + "," + std::to_string(7.5 + i) + ",3.1\n";
      for (const char* const camera : {"cam0", "cam1"}) {
        const fs::path images = recording / "undistorted_images" / camera;
        fs::rename(images / (frame_name(i) + ".png"), images / (std::to_string(i) + ".png"));
      }
    }
    write_text(recording / "times.txt", times);
    const auto sequence = open(folder.path());
    REQUIRE(sequence->size() == kFrames);
    CHECK(sequence->info().times[0] == Approx(7.5));
    CHECK(sequence->info().times[3] == Approx(10.5));
  }
  SECTION("a part of the images") {
    fs::remove(recording / "undistorted_images/cam0" / (frame_name(0) + ".png"));
    fs::remove(recording / "undistorted_images/cam1" / (frame_name(3) + ".png"));
    const auto sequence = open(folder.path());
    CHECK(sequence->size() == kFrames - 2);
    REQUIRE(sequence->info().warnings.size() == 1);
    CHECK(sequence->info().warnings[0].find("1 of cam0's and 1 of cam1's") != std::string::npos);
  }
  SECTION("images without a time") {
    write_picture(recording / "undistorted_images/cam0/preview.png",
                  test_picture(kWidth, kHeight, 0));
    REQUIRE(open(folder.path())->info().warnings.size() == 1);
    CHECK(open(folder.path())->info().warnings[0].find("1 images without a time are left out") !=
          std::string::npos);
  }
}

TEST_CASE("a 4Seasons recording that cannot be used is refused with one line") {
  const TempFolder folder;
  write_four_seasons(folder.path());
  const fs::path recording = folder.path() / kRecording,
                 calibration = folder.path() / "calibration";
  std::string expected;
  SECTION("no calibration") {
    fs::remove_all(calibration);
    expected = "there is no folder calibration in it or beside it";
  }
  SECTION("no transform") {
    fs::remove(calibration / "undistorted_calib_stereo.txt");
    expected = "undistorted_calib_stereo.txt: no such file";
  }
  SECTION("cameras exchanged") {
    write_text(calibration / "undistorted_calib_stereo.txt", matrix(0.3));
    expected = "the baseline is not positive; are the cameras or their files exchanged?";
  }
  SECTION("another image size") {
    for (const char* const name : {"undistorted_calib_0.txt", "undistorted_calib_1.txt"}) {
      replace_text(calibration / name, "96 64", "192 128");
    }
    expected = "calibrated for 192x128, but the images are 96x64";
  }
  SECTION("no right images") {
    fs::remove_all(recording / "undistorted_images/cam1");
    expected = "undistorted_images/cam1: no such folder";
  }
  SECTION("times of other images") {
    write_text(recording / "times.txt", "7 8.5 1\n");
    expected = "undistorted_images/cam0: holds no images that times.txt names";
  }
  SECTION("a frame twice in the times") {
    write_text(recording / "times.txt", "7 8.5 1\n7 9 1\n");
    expected = "times.txt:2: frame \"7\" has a time already";
  }
  SECTION("a quaternion of the truth") {
    replace_text(recording / "GNSSPoses.txt", "0.6,0,0.8", "0.6,0,0.9");
    expected = "GNSSPoses.txt:2: the quaternion is not of unit length";
  }
  const std::string line = open_complaint(folder.path());
  INFO(expected << "\n" << line);
  CHECK(line.find(expected) != std::string::npos);
}

TEST_CASE("the layout 4seasons wants such a recording") {
  const TempFolder folder;
  CHECK(open_complaint(folder.path(), "", SequenceLayout::kFourSeasons)
            .find("no 4Seasons sequence here") != std::string::npos);
}

}  // namespace
}  // namespace hybrid_slam
