#include "frontend/input/fisheye_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <catch2/catch.hpp>

#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

constexpr int kFisheyeSize = 400;

// 100 px per radian, to begin with.
Calibrated<KannalaBrandt> camera(double k1 = 0) {
  return {{100, 100, 205, 195, k1, 0, 0, 0}, kFisheyeSize, kFisheyeSize};
}

double radius(int x, int y) { return std::hypot(x - 205.0, y - 195.0); }

// Bright within a circle, dark and noisy outside.
GrayImage circle_image(double circle, int bright, int dark = 5) {
  std::mt19937 random(1);
  GrayImage image{kFisheyeSize, kFisheyeSize,
                  std::vector<std::uint8_t>(kFisheyeSize * kFisheyeSize)};
  for (int y = 0; y < kFisheyeSize; ++y) {
    for (int x = 0; x < kFisheyeSize; ++x) {
      const int noise = static_cast<int>(random() % 7) - 3;
      const int level = radius(x, y) <= circle ? bright + 10 * ((x / 8 + y / 8) % 3) : dark;
      image.row(y)[x] = static_cast<std::uint8_t>(std::clamp(level + noise, 0, 255));
    }
  }
  return image;
}

// The farthest pixel that a mask leaves, if it leaves a disk; else the test fails.
double disk_radius(const GrayImage& mask) {
  double inside = 0;
  double outside = 1e9;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (mask.row(y)[x] != 0) {
        inside = std::max(inside, radius(x, y));
      } else {
        outside = std::min(outside, radius(x, y));
      }
    }
  }
  CHECK(inside < outside + 1e-9);
  return inside;
}

TEST_CASE("the image circle is found where there is one") {
  for (const double circle : {90.0, 150.0, 180.0}) {
    const auto found = find_image_circle(camera(), circle_image(circle, 40));
    REQUIRE(found);
    CHECK(std::abs(*found - circle) <= 3);
  }
  CHECK(!find_image_circle(camera(), circle_image(1000, 40)));  // reaches to the corners
  CHECK(!find_image_circle(camera(), circle_image(150, -5)));   // as dark inside
  CHECK(!find_image_circle(camera(),
                           GrayImage{kFisheyeSize, kFisheyeSize,
                                     std::vector<std::uint8_t>(kFisheyeSize * kFisheyeSize)}));
}

TEST_CASE("the mask is the circle of most examples, less the border") {
  FisheyeViewOptions options;
  options.border = 10;
  const std::vector<GrayImage> examples{circle_image(150, 40), circle_image(150, -5),
                                        circle_image(150, 90)};
  CHECK(std::abs(disk_radius(make_fisheye_mask(camera(), examples, options)) - 140) <= 3);
  // Nothing found: all that the model shows, and that is the whole image here.
  const GrayImage all = make_fisheye_mask(camera(), {}, options);
  CHECK(std::count(all.pixels.begin(), all.pixels.end(), 0) == 0);
}

TEST_CASE("a given angle goes before what is found") {
  FisheyeViewOptions options;
  options.border = 0;
  options.max_angle_deg = 60;
  const std::vector<GrayImage> examples{circle_image(150, 40)};
  const double expected = 100 * std::numbers::pi / 3;
  CHECK(disk_radius(make_fisheye_mask(camera(), examples, options)) == Approx(expected).margin(1));
}

TEST_CASE("a user's mask takes parts out, and must have the image's size") {
  const TempFolder folder;
  cv::Mat picture(kFisheyeSize, kFisheyeSize, CV_8UC1, cv::Scalar(255));
  picture(cv::Rect(180, 160, 30, 40)) = 0;
  write_picture(folder.path() / "mask.png", picture);
  FisheyeViewOptions options;
  options.mask = (folder.path() / "mask.png").string();
  const std::vector<GrayImage> examples{circle_image(150, 40)};
  const GrayImage mask = make_fisheye_mask(camera(), examples, options);
  CHECK(mask.row(180)[190] == 0);
  CHECK(mask.row(210)[190] != 0);
  CHECK(mask.row(5)[5] == 0);
  write_picture(folder.path() / "mask.png", picture(cv::Rect(0, 0, 300, 400)));
  CHECK(complaint([&] { make_fisheye_mask(camera(), examples, options); }).find("mask.png") !=
        std::string::npos);
  options.mask = "nowhere.png";
  CHECK(complaint([&] { make_fisheye_mask(camera(), examples, options); }).find("nowhere.png") !=
        std::string::npos);
}

TEST_CASE("a model that folds within the circle is refused") {
  // theta (1 - 0.3 theta^2) grows up to sqrt(1 / 0.9) = 1.054 rad, at 70 px.
  const std::vector<GrayImage> examples{circle_image(150, 40)};
  const std::string line = complaint([&] { make_fisheye_mask(camera(-0.3), examples, {}); });
  CHECK(line.find("folds 70 px") != std::string::npos);
  FisheyeViewOptions options;
  options.max_angle_deg = 50;  // the user knows what can be used
  CHECK_NOTHROW(make_fisheye_mask(camera(-0.3), examples, options));
}

TEST_CASE("contrast enhancement widens the range of a hazy image") {
  GrayImage image = circle_image(1000, 100);
  const auto spread = [&] {
    const auto [low, high] = std::minmax_element(image.pixels.begin(), image.pixels.end());
    return *high - *low;
  };
  const int before = spread();
  enhance_contrast(image, 4);
  CHECK(spread() > 1.5 * before);
}

TEST_CASE("FisheyeViewOptions out of range are refused") {
  CHECK(FisheyeViewOptions().validate().empty());
  FisheyeViewOptions options;
  options.max_angle_deg = 181;
  CHECK(!options.validate().empty());
  options = {};
  options.border = -1;
  CHECK(!options.validate().empty());
  options = {};
  options.clahe = std::nan("");
  CHECK(!options.validate().empty());
}

}  // namespace
}  // namespace hybrid_slam
