#include "apps/feature_eval/pictures.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/io/picture_file.h"

namespace hybrid_slam {
namespace {

constexpr int kSmallSide = 1000;     // [px] images with a longer side below it are enlarged
constexpr float kCircleScales = 3;   // radius of a circle in the keypoint's scales
constexpr float kLargestScale = 20;  // [px] that has a colour of its own
constexpr int kSubPixel = 4;         // bits of the fraction of a pixel in OpenCV's drawing
constexpr int kGap = 8;              // [px] between two images
constexpr double kLineOpacity = 0.4;

int zoom_of(const GrayImage& image) {
  return std::max(1, static_cast<int>(std::lround(static_cast<double>(kSmallSide) /
                                                  std::max(image.width, image.height))));
}

cv::Mat enlarged(const GrayImage& image, int zoom) {
  const cv::Mat gray(image.height, image.width, CV_8UC1,
                     const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat color;
  cv::cvtColor(gray, color, cv::COLOR_GRAY2BGR);
  cv::resize(color, color, {}, zoom, zoom, cv::INTER_NEAREST);
  return color;
}

// Light blue for 0, over green, to red for 1.
cv::Scalar color_of(double share) {
  const double hue = 3.5 * (1 - std::clamp(share, 0.0, 1.0));  // sixths of the circle of colours
  const auto level = [&](double centre, double width) {
    return 255 * std::clamp(width - std::abs(hue - centre), 0.0, 1.0);
  };
  return {level(4, 2), level(2, 2), level(0, 2)};
}

// Fixed-point coordinates, as OpenCV's drawing wants them, in the enlarged image.
cv::Point place(float x, float y, int zoom, int shift_right = 0) {
  const auto fixed = [&](double value, int shift) {
    return static_cast<int>(std::lround(((value + 0.5) * zoom - 0.5 + shift) * (1 << kSubPixel)));
  };
  return {fixed(x, shift_right), fixed(y, 0)};
}

}  // namespace

void write_keypoint_picture(const std::filesystem::path& path, const GrayImage& image,
                            const std::vector<Keypoint>& keypoints) {
  const int zoom = zoom_of(image);
  cv::Mat picture = enlarged(image, zoom);
  for (const Keypoint& k : keypoints) {
    const float radius = kCircleScales * k.scale;
    const cv::Point centre = place(k.x, k.y, zoom);
    const cv::Point end =
        place(k.x + radius * std::cos(k.angle), k.y + radius * std::sin(k.angle), zoom);
    const cv::Scalar color = color_of(std::log(std::max(k.scale, 1.0F)) / std::log(kLargestScale));
    const int fixed_radius =
        static_cast<int>(std::lround(radius * static_cast<float>(zoom << kSubPixel)));
    cv::circle(picture, centre, fixed_radius, color, 1, cv::LINE_AA, kSubPixel);
    cv::line(picture, centre, end, color, 1, cv::LINE_AA, kSubPixel);
  }
  write_picture(path, picture);
}

void write_match_picture(const std::filesystem::path& path, const GrayImage& first,
                         const std::vector<Keypoint>& first_keypoints, const GrayImage& second,
                         const std::vector<Keypoint>& second_keypoints,
                         const std::vector<FeatureMatch>& matches) {
  const int zoom = std::min(zoom_of(first), zoom_of(second));
  const cv::Mat left = enlarged(first, zoom), right = enlarged(second, zoom);
  const int shift = left.cols + kGap;
  cv::Mat picture(std::max(left.rows, right.rows), shift + right.cols, CV_8UC3,
                  cv::Scalar(255, 255, 255));
  left.copyTo(picture({0, 0, left.cols, left.rows}));
  right.copyTo(picture({shift, 0, right.cols, right.rows}));
  const auto draw_each = [&](cv::Mat& target, const auto& draw) {
    for (const FeatureMatch& match : matches) {
      const Keypoint& a = first_keypoints[static_cast<std::size_t>(match.query)];
      const Keypoint& b = second_keypoints[static_cast<std::size_t>(match.train)];
      draw(target, place(a.x, a.y, zoom), place(b.x, b.y, zoom, shift),
           color_of(a.y / static_cast<float>(first.height)));
    }
  };
  cv::Mat lines = picture.clone();
  draw_each(lines, [](cv::Mat& target, cv::Point from, cv::Point to, const cv::Scalar& color) {
    cv::line(target, from, to, color, 1, cv::LINE_AA, kSubPixel);
  });
  cv::addWeighted(lines, kLineOpacity, picture, 1 - kLineOpacity, 0, picture);
  draw_each(picture, [](cv::Mat& target, cv::Point from, cv::Point to, const cv::Scalar& color) {
    for (const cv::Point end : {from, to}) {
      cv::circle(target, end, 3 << kSubPixel, color, cv::FILLED, cv::LINE_AA, kSubPixel);
    }
  });
  write_picture(path, picture);
}

}  // namespace hybrid_slam
