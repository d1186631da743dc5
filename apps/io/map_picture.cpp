#include "apps/io/map_picture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/io/picture_file.h"

namespace hybrid_slam {

namespace {

using Points = std::vector<Eigen::Vector3d>;

// Layout of the picture [px].
constexpr int kPanelWidth = 800;
constexpr int kPanelHeight = 760;
constexpr int kTop = 90;      // title and legend
constexpr int kLeft = 75;     // numbers of the vertical axis
constexpr int kBottom = 70;   // numbers of the horizontal axis
constexpr int kMargin = 20;   // right of a panel
constexpr int kSubPixel = 4;  // bits of the fraction of a pixel in OpenCV's drawing

constexpr double kLowPercentile = 0.02;  // of the points, at either end of either axis
constexpr double kBorder = 0.06;         // around what is shown, of its size

const cv::Scalar kInk(40, 40, 40);
const cv::Scalar kGrid(232, 232, 232);
const cv::Scalar kPathColor(30, 90, 235);           // orange red (BGR)
const cv::Scalar kTruthColor(70, 150, 40);          // green
const cv::Scalar kPointColor(165, 120, 70);         // steel blue
const cv::Scalar kFisheyePointColor(150, 60, 170);  // purple
const cv::Scalar kFisheyePathColor(120, 20, 140);   // dark purple

// The two axes of a panel: which coordinate goes right and which up, and with which sign.
struct View {
  std::string title;
  int right = 0;
  int up = 1;
  double up_sign = 1;
};

struct Range {
  double low = 0;
  double high = 1;
};

Points only_finite(const Points& points) {
  Points result;
  std::copy_if(points.begin(), points.end(), std::back_inserter(result),
               [](const Eigen::Vector3d& p) { return p.allFinite(); });
  return result;
}

std::array<View, 2> choose_views(const Points& path) {
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : path) {
    low = low.cwiseMin(p - path.front());
    high = high.cwiseMax(p - path.front());
  }
  const Eigen::Vector3d extent = high - low;
  if (extent.z() >= extent.y()) {
    return {View{"from above (x right, z forward)", 0, 2, 1},
            View{"from the side (z forward, y down)", 2, 1, -1}};
  }
  return {View{"along the first camera's axis (x right, y down)", 0, 1, -1},
          View{"from the side (x right, z forward)", 0, 2, 1}};
}

// Of most points, and all that lies on a path.
Range robust_range(const Points& points, const Points& paths, int axis) {
  std::vector<double> values;
  for (const Eigen::Vector3d& p : points) values.push_back(p[axis]);
  std::sort(values.begin(), values.end());
  Range range{0, 0};
  if (!values.empty()) {
    const auto skip = static_cast<std::size_t>(kLowPercentile * static_cast<double>(values.size()));
    range = {values[skip], values[values.size() - 1 - skip]};
  } else if (!paths.empty()) {
    range = {paths.front()[axis], paths.front()[axis]};
  }
  for (const Eigen::Vector3d& p : paths) {
    range.low = std::min(range.low, p[axis]);
    range.high = std::max(range.high, p[axis]);
  }
  return range;
}

// 1, 2 or 5 times a power of ten, at most `length`.
double round_length(double length) {
  const double power = std::pow(10, std::floor(std::log10(length)));
  for (const double step : {5.0, 2.0}) {
    if (step * power <= length) return step * power;
  }
  return power;
}

std::string number_text(double value, double step) {
  const int digits = std::clamp(static_cast<int>(-std::floor(std::log10(step) + 1e-9)), 0, 6);
  return fmt::format("{:.{}f}", std::abs(value) < 1e-9 * step ? 0.0 : value, digits);
}

void write_text(cv::Mat& image, const std::string& text, cv::Point at, double size,
                const cv::Scalar& color = kInk) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, color, 1, cv::LINE_AA);
}

int text_width(const std::string& text, double size) {
  int below = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &below).width;
}

// One view: a rectangle of the image with its own scale, the same along both axes.
class Panel {
 public:
  Panel(cv::Mat& image, int left, const View& view, Range right, Range up)
      : image_(image), area_(left + kLeft, kTop, kPanelWidth, kPanelHeight), view_(view) {
    const double width = right.high - right.low, height = up.high - up.low;
    const double size =
        (1 + 2 * kBorder) * std::max({width / area_.width, height / area_.height, 1e-9});
    pixels_per_metre_ = 1 / size;
    centre_right_ = 0.5 * (right.low + right.high);
    centre_up_ = 0.5 * (up.low + up.high);
  }

  void draw_frame() {
    const double step = round_length(140 / pixels_per_metre_);
    draw_ticks(step, true);
    draw_ticks(step, false);
    cv::rectangle(image_, area_, kInk, 1);
    write_text(image_, view_.title, {area_.x + 4, area_.y - 12}, 0.6);
    const std::string names = "xyz";
    write_text(image_, names.substr(static_cast<std::size_t>(view_.right), 1) + " [m]",
               {area_.x + area_.width - 42, area_.y + area_.height + 48}, 0.55);
    write_text(image_, names.substr(static_cast<std::size_t>(view_.up), 1) + " [m]",
               {area_.x - kLeft + 8, area_.y + 14}, 0.55);
  }

  // Each point darkens its place a little, so that dense structures stand out.
  void draw_points(const Points& points, const cv::Scalar& color) {
    cv::Mat count(area_.size(), CV_32FC1, cv::Scalar(0));
    for (const Eigen::Vector3d& point : points) {
      const cv::Point2d at = pixel(point);
      if (!inside(at)) continue;
      const cv::Point place = cv::Point(cvRound(at.x), cvRound(at.y)) - area_.tl();
      cv::circle(count, place, 1, count.at<float>(place) + 1, cv::FILLED);
    }
    for (int y = 0; y < count.rows; ++y) {
      for (int x = 0; x < count.cols; ++x) {
        const double n = count.at<float>(y, x);
        if (n == 0) continue;
        const double opacity = 1 - std::pow(0.55, n);
        auto& target = image_.at<cv::Vec3b>(area_.y + y, area_.x + x);
        for (int c = 0; c < 3; ++c) {
          target[c] = cv::saturate_cast<uchar>((1 - opacity) * target[c] + opacity * color[c]);
        }
      }
    }
  }

  void draw_path(const Points& path, const cv::Scalar& color, int thickness) {
    std::vector<cv::Point> corners;
    for (const Eigen::Vector3d& point : path) {
      const cv::Point2d at = pixel(point);
      corners.emplace_back(cvRound(at.x * (1 << kSubPixel)), cvRound(at.y * (1 << kSubPixel)));
    }
    if (corners.size() > 1) {
      cv::polylines(image_, corners, false, color, thickness, cv::LINE_AA, kSubPixel);
    }
  }

  void draw_ends(const Points& path) {
    if (path.empty()) return;
    const cv::Point first = pixel(path.front()), last = pixel(path.back());
    cv::circle(image_, first, 6, cv::Scalar(255, 255, 255), cv::FILLED, cv::LINE_AA);
    cv::circle(image_, first, 6, kPathColor, 2, cv::LINE_AA);
    cv::rectangle(image_, last - cv::Point(5, 5), last + cv::Point(5, 5), kPathColor, cv::FILLED);
  }

  void draw_keyframes(const Points& keyframes, const cv::Scalar& color) {
    for (const Eigen::Vector3d& keyframe : keyframes) {
      const cv::Point at = pixel(keyframe);
      cv::rectangle(image_, at - cv::Point(3, 3), at + cv::Point(3, 3), color, 1, cv::LINE_AA);
    }
  }

  void draw_scale_bar() {
    const double length = round_length(160 / pixels_per_metre_);
    const int width = cvRound(length * pixels_per_metre_);
    const cv::Point right(area_.x + area_.width - 20, area_.y + area_.height - 20);
    const cv::Point left = right - cv::Point(width, 0);
    cv::rectangle(image_, left + cv::Point(-12, -32), right + cv::Point(12, 12),
                  cv::Scalar(255, 255, 255), cv::FILLED);
    cv::line(image_, left, right, kInk, 2);
    for (const cv::Point end : {left, right}) {
      cv::line(image_, end - cv::Point(0, 5), end + cv::Point(0, 5), kInk, 2);
    }
    const std::string text = length >= 1000
                                 ? number_text(length / 1000, length / 1000) + " km"
                                 : (length >= 1 ? number_text(length, length) + " m"
                                                : number_text(100 * length, 100 * length) + " cm");
    write_text(image_, text, {(left.x + right.x - text_width(text, 0.55)) / 2, left.y - 12}, 0.55);
  }

 private:
  cv::Point2d pixel(const Eigen::Vector3d& p) const {
    return {area_.x + 0.5 * area_.width + (p[view_.right] - centre_right_) * pixels_per_metre_,
            area_.y + 0.5 * area_.height -
                view_.up_sign * (p[view_.up] - centre_up_) * pixels_per_metre_};
  }

  bool inside(const cv::Point2d& at) const {
    return at.x >= area_.x + 1 && at.y >= area_.y + 1 && at.x < area_.x + area_.width - 2 &&
           at.y < area_.y + area_.height - 2;
  }

  void draw_ticks(double step, bool horizontal) {
    const double centre = horizontal ? centre_right_ : centre_up_;
    const double half = 0.5 * (horizontal ? area_.width : area_.height) / pixels_per_metre_;
    for (double i = std::ceil((centre - half) / step); i * step <= centre + half; ++i) {
      const std::string text = number_text(i * step, step);
      Eigen::Vector3d point = Eigen::Vector3d::Zero();
      point[horizontal ? view_.right : view_.up] = i * step;
      const cv::Point at = pixel(point);
      if (horizontal) {
        cv::line(image_, {at.x, area_.y}, {at.x, area_.y + area_.height}, kGrid, 1);
        write_text(image_, text, {at.x - text_width(text, 0.5) / 2, area_.y + area_.height + 22},
                   0.5);
      } else {
        cv::line(image_, {area_.x, at.y}, {area_.x + area_.width, at.y}, kGrid, 1);
        if (at.y > area_.y + 24) {
          write_text(image_, text, {area_.x - 8 - text_width(text, 0.5), at.y + 5}, 0.5);
        }
      }
    }
  }

  cv::Mat& image_;
  cv::Rect area_;
  View view_;
  double pixels_per_metre_ = 1;
  double centre_right_ = 0;
  double centre_up_ = 0;
};

void draw_legend(cv::Mat& image, const MapPicture& picture) {
  write_text(image, picture.title, {kLeft + 4, 34}, 0.8);
  const bool hybrid = !picture.fisheye_path.empty();
  int x =
      hybrid ? kLeft + text_width(picture.title, 0.8) + 40 : kLeft + kPanelWidth + kMargin + kLeft;
  const auto entry = [&](const std::string& text, const cv::Scalar& color, bool line) {
    if (line) {
      cv::line(image, {x, 28}, {x + 30, 28}, color, 3, cv::LINE_AA);
    } else {
      cv::circle(image, {x + 15, 28}, 4, color, cv::FILLED, cv::LINE_AA);
    }
    write_text(image, text, {x + 38, 34}, 0.6);
    x += 38 + text_width(text, 0.6) + 24;
  };
  const char* const of_stereo = hybrid ? "stereo " : "";
  entry(fmt::format("{} {}landmarks", picture.points.size(), of_stereo), kPointColor, false);
  entry(fmt::format("{}path (o start, # end)", of_stereo), kPathColor, true);
  if (hybrid) {
    entry(fmt::format("{} fisheye landmarks", picture.fisheye_points.size()), kFisheyePointColor,
          false);
    entry("fisheye path", kFisheyePathColor, true);
  }
  if (!picture.truth.empty()) entry("truth", kTruthColor, true);
}

// Only what is finite, in every list.
MapPicture drawable(MapPicture picture) {
  for (Points* const list :
       {&picture.points, &picture.path, &picture.truth, &picture.keyframes, &picture.fisheye_points,
        &picture.fisheye_path, &picture.fisheye_truth, &picture.fisheye_keyframes}) {
    *list = only_finite(*list);
  }
  return picture;
}

// All that must be seen whole.
Points all_paths(const MapPicture& picture) {
  Points all = picture.path;
  for (const Points* const list : {&picture.truth, &picture.fisheye_path, &picture.fisheye_truth}) {
    all.insert(all.end(), list->begin(), list->end());
  }
  return all;
}

void draw(const MapPicture& picture, Panel& panel) {
  panel.draw_frame();
  panel.draw_points(picture.points, kPointColor);
  panel.draw_points(picture.fisheye_points, kFisheyePointColor);
  for (const Points* const truth : {&picture.truth, &picture.fisheye_truth}) {
    panel.draw_path(*truth, kTruthColor, 4);
  }
  panel.draw_path(picture.fisheye_path, kFisheyePathColor, 2);
  panel.draw_keyframes(picture.fisheye_keyframes, kFisheyePathColor);
  panel.draw_path(picture.path, kPathColor, 2);
  panel.draw_keyframes(picture.keyframes, kPathColor);
  panel.draw_ends(picture.path);
  panel.draw_scale_bar();
}

}  // namespace

void write_map_picture(const std::filesystem::path& path, const MapPicture& given) {
  const MapPicture picture = drawable(given);
  Points points = picture.points;
  points.insert(points.end(), picture.fisheye_points.begin(), picture.fisheye_points.end());
  const Points paths = all_paths(picture);
  cv::Mat image(kTop + kPanelHeight + kBottom, 2 * (kLeft + kPanelWidth + kMargin), CV_8UC3,
                cv::Scalar(255, 255, 255));
  draw_legend(image, picture);
  int left = 0;
  for (const View& view : choose_views(picture.path)) {
    Panel panel(image, left, view, robust_range(points, paths, view.right),
                robust_range(points, paths, view.up));
    draw(picture, panel);
    left += kLeft + kPanelWidth + kMargin;
  }
  write_picture(path, image);
}

}  // namespace hybrid_slam
