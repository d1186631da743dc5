#include "frontend/matching/optical_flow.h"

#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>

namespace hybrid_slam {
namespace {

constexpr int kWindow = 21;           // [px]
constexpr int kLevels = 4;            // above the image itself
constexpr float kMaxBackError = 1.0;  // [px]

cv::Mat to_bytes(const ImagePyramid& pyramid) {
  const ImagePyramid::Level& image = pyramid.level(0);
  const cv::Mat view(image.height, image.width, CV_16U,
                     const_cast<std::uint16_t*>(image.pixels.data()));
  cv::Mat bytes;
  view.convertTo(bytes, CV_8U, 1 / ImagePyramid::kUnits);
  return bytes;
}

}  // namespace

std::vector<FlowMatch> follow_patches(const ImagePyramid& from, const ImagePyramid& to,
                                      std::span<const Eigen::Vector2f> points) {
  if (points.empty()) return {};
  std::vector<cv::Point2f> start, there, back;
  for (const Eigen::Vector2f& point : points) start.emplace_back(point.x(), point.y());
  const cv::Mat a = to_bytes(from), b = to_bytes(to);
  std::vector<unsigned char> found, found_back;
  const cv::Size window(kWindow, kWindow);
  cv::calcOpticalFlowPyrLK(a, b, start, there, found, cv::noArray(), window, kLevels);
  cv::calcOpticalFlowPyrLK(b, a, there, back, found_back, cv::noArray(), window, kLevels);
  std::vector<FlowMatch> matches;
  for (std::size_t i = 0; i < start.size(); ++i) {
    if (found[i] == 0 || found_back[i] == 0) continue;
    const cv::Point2f off = back[i] - start[i];
    if (off.dot(off) > kMaxBackError * kMaxBackError) continue;
    matches.push_back({static_cast<int>(i), {there[i].x, there[i].y}});
  }
  return matches;
}

}  // namespace hybrid_slam
