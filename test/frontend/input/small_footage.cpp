#include "test/frontend/input/small_footage.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>

namespace hybrid_slam::small_footage {
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

cv::Mat picture_of(int frame, int side) { return test_picture(kWidth, kHeight, 10 * frame + side); }

// Images of these names (without ending), in a folder.
void write_images(const fs::path& folder, const Names& names, int side) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    write_picture(folder / (names[i] + ".png"), picture_of(static_cast<int>(i), side));
  }
}

std::string kitti_calibration() {
  return "P0: 80 0 47.5 0 0 80 31.5 0 0 0 1 0\nP1: 80 0 47.5 -9.6 0 80 31.5 0 0 0 1 0\n"
         "P2: 80 0 47.5 4 0 80 31.5 0 0 0 1 0\nP3: 80 0 47.5 -12 0 80 31.5 0 0 0 1 0\n";
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

std::unique_ptr<ImageSequence> open_rectified(const Footage& footage) {
  return open_footage(footage, FootageImages::kRectified, {});
}

std::string refusal_of(const Footage& footage, FootageImages images) {
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

}  // namespace hybrid_slam::small_footage
