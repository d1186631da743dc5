#include "frontend/matching/image_pyramid.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

namespace hybrid_slam {
namespace {

constexpr int kMinLevelSize = 16;

ImagePyramid::Level to_level(const cv::Mat& pixels) {
  ImagePyramid::Level level;
  level.width = pixels.cols;
  level.height = pixels.rows;
  level.pixels.reserve(pixels.total());
  for (int y = 0; y < pixels.rows; ++y) {
    const float* row = pixels.ptr<float>(y);
    level.pixels.insert(level.pixels.end(), row, row + pixels.cols);
  }
  return level;
}

// Every other pixel, blurred so far that the half-size image has the blur it had before.
cv::Mat halve(const cv::Mat& pixels, double blur) {
  cv::Mat smooth;
  cv::GaussianBlur(pixels, smooth, cv::Size(), std::sqrt(3.0) * blur);
  cv::Mat half((pixels.rows + 1) / 2, (pixels.cols + 1) / 2, CV_32F);
  for (int y = 0; y < half.rows; ++y) {
    const float* from = smooth.ptr<float>(2 * y);
    float* to = half.ptr<float>(y);
    for (int x = 0; x < half.cols; ++x) to[x] = from[2 * x];
  }
  return half;
}

}  // namespace

ImagePyramid::ImagePyramid(const GrayImage& image, int levels, double blur) {
  if (image.empty()) throw std::logic_error("ImagePyramid: empty image");
  const cv::Mat bytes(image.height, image.width, CV_8UC1,
                      const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat pixels;
  bytes.convertTo(pixels, CV_32F);
  cv::GaussianBlur(pixels, pixels, cv::Size(), blur);
  levels_.push_back(to_level(pixels));
  while (this->levels() < levels && (std::min(pixels.rows, pixels.cols) + 1) / 2 >= kMinLevelSize) {
    pixels = halve(pixels, blur);
    levels_.push_back(to_level(pixels));
  }
}

}  // namespace hybrid_slam
