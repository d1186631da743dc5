// Matching on the shared sequences whose poses are known.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "frontend/features/sift.h"
#include "frontend/matching/circular_matcher.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {
namespace {

std::optional<std::string> data_folder() {
  const char* folder = std::getenv("HYBRID_SLAM_DATA");
  if (folder) return std::string(folder) + "/";
  std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
  return std::nullopt;
}

GrayImage load(const std::string& path) {
  const cv::Mat pixels = cv::imread(path, cv::IMREAD_GRAYSCALE);
  INFO(path);
  REQUIRE_FALSE(pixels.empty());
  GrayImage image{pixels.cols, pixels.rows, {}};
  for (int y = 0; y < pixels.rows; ++y) {
    const std::uint8_t* row = pixels.ptr<std::uint8_t>(y);
    image.pixels.insert(image.pixels.end(), row, row + pixels.cols);
  }
  return image;
}

// The numbers in line `index` of a file, comments not counted.
std::vector<double> read_line(const std::string& path, int index) {
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#' || index-- > 0) continue;
    std::istringstream stream(line);
    std::vector<double> numbers;
    for (double number = 0; stream >> number;) numbers.push_back(number);
    return numbers;
  }
  FAIL(path);
  return {};
}

StereoFeatures stereo_features(const std::string& left, const std::string& right,
                               const Calibrated<RectifiedStereo>& camera, bool refine) {
  const auto sift = make_sift({});
  const GrayImage left_image = load(left);
  const GrayImage right_image = load(right);
  const ImagePyramid left_pyramid(left_image);
  const ImagePyramid right_pyramid(right_image);
  StereoMatcherOptions options;
  options.refine = refine;
  return match_stereo(sift->extract(left_image, nullptr), sift->extract(right_image, nullptr),
                      &left_pyramid, &right_pyramid, camera, options);
}

double median_size(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct Agreement {
  int circles = 0;
  int right = 0;               // circles within `threshold` of where the true motion has them
  double disparity_sigma = 0;  // [px], robust, of one measurement
};

// Carries the points of the previous frame into the current one by the true motion.
Agreement check(const StereoFeatures& previous, const StereoFeatures& current,
                const Calibrated<RectifiedStereo>& camera,
                const Eigen::Isometry3d& current_from_previous, double threshold) {
  Agreement agreement;
  std::vector<double> disparity_errors;
  for (const CircularMatch& circle : match_circular(previous, current, {})) {
    const auto p = static_cast<std::size_t>(circle.previous);
    const auto c = static_cast<std::size_t>(circle.current);
    const Keypoint& from = previous.left.keypoints[p];
    const Keypoint& to = current.left.keypoints[c];
    const auto before = triangulate_stereo(camera, {from.x, from.y, previous.u_right[p]});
    REQUIRE(before);
    const auto expected = project_stereo(camera, current_from_previous * *before);
    ++agreement.circles;
    if (!expected || std::hypot(expected->x() - to.x, expected->y() - to.y) > threshold) continue;
    ++agreement.right;
    const double expected_disparity = expected->x() - expected->z();
    const double change = expected_disparity / (from.x - previous.u_right[p]);
    const double error = to.x - current.u_right[c] - expected_disparity;
    disparity_errors.push_back(error / std::sqrt(1 + std::pow(change, 4)));
  }
  REQUIRE(agreement.right > 100);
  agreement.disparity_sigma = 1.4826 * median_size(disparity_errors);
  return agreement;
}

TEST_CASE(
    "Rendered reef: circles agree with the true motion, disparities to a twentieth of a pixel") {
  const auto data = data_folder();
  if (!data) return;
  const std::string folder = *data + "uwsynth/hybrid/H1/";
  const Calibrated<RectifiedStereo> camera{{868.417, 868.417, 506.283, 391.742, 0.15}, 1024, 768};
  const auto frame = [&](int k, bool refine) {
    const std::string image = folder + "images/raw/" + std::to_string(k);
    return stereo_features(image + "_left.jpg", image + "_right.jpg", camera, refine);
  };
  const auto world_from_cam = [&](int k) {
    const std::vector<double> n = read_line(folder + "gt_left_tum.txt", k);
    return Eigen::Isometry3d(Eigen::Translation3d(n[1], n[2], n[3]) *
                             Eigen::Quaterniond(n[7], n[4], n[5], n[6]).normalized());
  };
  const Eigen::Isometry3d motion = world_from_cam(15).inverse() * world_from_cam(10);
  const Agreement plain = check(frame(10, false), frame(15, false), camera, motion, 2);
  const Agreement refined = check(frame(10, true), frame(15, true), camera, motion, 2);
  INFO("circles " << refined.circles << ", right " << refined.right << ", disparity "
                  << plain.disparity_sigma << " -> " << refined.disparity_sigma);
  CHECK(refined.circles > 450);
  CHECK(refined.right > 0.97 * refined.circles);
  CHECK(refined.disparity_sigma < 0.08);
  CHECK(refined.disparity_sigma < 0.6 * plain.disparity_sigma);
}

TEST_CASE("Street: circles agree with the true motion") {
  const auto data = data_folder();
  if (!data) return;
  const std::string folder = *data + "kitti/";
  const Calibrated<RectifiedStereo> camera{
      {707.0912, 707.0912, 601.8873, 183.1104, 379.8145 / 707.0912}, 1226, 370};
  const auto frame = [&](int k) {
    const std::string name = "/00000" + std::to_string(k) + ".png";
    return stereo_features(folder + "sequences/s1/image_0" + name,
                           folder + "sequences/s1/image_1" + name, camera, true);
  };
  const auto world_from_cam = [&](int k) {
    const std::vector<double> n = read_line(folder + "poses/s1.txt", k);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (int i = 0; i < 12; ++i) pose(i / 4, i % 4) = n[static_cast<std::size_t>(i)];
    return pose;
  };
  const Agreement found =
      check(frame(4), frame(5), camera, world_from_cam(5).inverse() * world_from_cam(4), 3);
  INFO("circles " << found.circles << ", right " << found.right << ", disparity "
                  << found.disparity_sigma);
  CHECK(found.circles > 270);
  CHECK(found.right > 0.85 * found.circles);  // no ratio test: RANSAC sorts out the rest
  CHECK(found.disparity_sigma < 0.2);
}

}  // namespace
}  // namespace hybrid_slam
