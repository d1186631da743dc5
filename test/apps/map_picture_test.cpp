#include "apps/io/map_picture.h"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>

#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "test/apps/trajectories.h"

namespace hybrid_slam {
namespace {

MapPicture street() {
  MapPicture picture;
  picture.title = "a street";
  for (const StampedPose& pose : winding_path(300)) {
    picture.path.push_back(pose.world_from_cam.translation());
    picture.truth.push_back(picture.path.back() + Eigen::Vector3d(0.4, 0.1, 0));
  }
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) {
    const double side = i % 2 == 0 ? -8 : 8;
    picture.points.emplace_back(side + normal(random), -2 + 1.5 * normal(random),
                                25 + 15 * normal(random));
  }
  return picture;
}

// Pixels of about this colour in a part of the image.
int count_color(const cv::Mat& image, const cv::Vec3b& color) {
  int count = 0;
  for (const cv::Vec3b& pixel : cv::Mat_<cv::Vec3b>(image)) {
    if (cv::norm(cv::Vec3d(pixel) - cv::Vec3d(color)) < 40) ++count;
  }
  return count;
}

const cv::Vec3b kPath(30, 90, 235), kTruth(70, 150, 40);

TEST_CASE("the picture shows path and truth in both views") {
  const TempFolder folder;
  const char* const kept = std::getenv("HYBRID_SLAM_PICTURES");
  const auto path = (kept != nullptr ? std::filesystem::path(kept) : folder.path()) / "street.png";
  write_map_picture(path, street());
  const cv::Mat image = cv::imread(path.string());
  REQUIRE(image.cols > 1000);
  for (const cv::Mat& half :
       {image.colRange(0, image.cols / 2), image.colRange(image.cols / 2, image.cols)}) {
    const cv::Mat drawing = half.rowRange(90, half.rows);
    CHECK(count_color(drawing, kPath) > 300);
    CHECK(count_color(drawing, kTruth) > 100);
  }
}

TEST_CASE("far outliers do not squash the view") {
  const TempFolder folder;
  MapPicture picture = street();
  write_map_picture(folder.path() / "a.png", picture);
  for (int i = 0; i < 100; ++i) picture.points.emplace_back(1e5, -1e5 * i, 1e6);
  picture.points.emplace_back(std::numeric_limits<double>::quiet_NaN(), 0, 0);
  picture.points.emplace_back(std::numeric_limits<double>::infinity(), 0, 0);
  write_map_picture(folder.path() / "b.png", picture);
  const int before = count_color(cv::imread((folder.path() / "a.png").string()), kPath);
  const int after = count_color(cv::imread((folder.path() / "b.png").string()), kPath);
  CHECK(after > 0.8 * before);
}

TEST_CASE("pictures of nothing, of one place and of huge maps are drawn") {
  const TempFolder folder;
  const auto path = folder.path() / "a.png";
  write_map_picture(path, {});
  CHECK(cv::imread(path.string()).cols > 1000);
  write_map_picture(path, {"one", {{1, 1, 1}}, {{1, 1, 1}, {1, 1, 1}}, {}, {}, {}, {}, {}, {}});
  CHECK(count_color(cv::imread(path.string()), kPath) > 50);
  write_map_picture(
      path, {"huge", {{1e9, 0, -1e9}}, {{0, 0, 0}, {1e12, 1e12, 1e12}}, {}, {}, {}, {}, {}, {}});
  CHECK(count_color(cv::imread(path.string()), kPath) > 50);
}

}  // namespace
}  // namespace hybrid_slam
