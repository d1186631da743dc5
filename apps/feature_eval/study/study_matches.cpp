#include <algorithm>
#include <iterator>

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/feature_eval/study/study_charts.h"
#include "apps/report/jpeg_encoder.h"

namespace hybrid_slam {
namespace {

constexpr int kShownHeight = 400;  // [px] of both images
constexpr int kGap = 8;            // [px] between them
constexpr int kQuality = 75;       // of their JPEG
constexpr std::size_t kMostLines = 150;

double zoom_of(const GrayImage& image) {
  return image.height > 0 ? static_cast<double>(kShownHeight) / image.height : 1;
}

int shown_width(const GrayImage& image) {
  return std::max(1, static_cast<int>(std::lround(zoom_of(image) * image.width)));
}

std::string base64(const std::string& bytes) {
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k > bytes.size() ? '=' : kDigits[group >> (18 - 6 * k) & 63];
    }
  }
  return text;
}

void add_image(std::string& svg, const GrayImage& image, int left) {
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat small;
  cv::resize(pixels, small, {shown_width(image), kShownHeight}, 0, 0, cv::INTER_AREA);
  const GrayImage shown{
      small.cols, small.rows, {small.begin<std::uint8_t>(), small.end<std::uint8_t>()}};
  fmt::format_to(std::back_inserter(svg),
                 R"(<image x="{}" y="0" width="{}" height="{}" href="data:image/jpeg;base64,{}"/>)",
                 left, shown.width, shown.height, base64(encode_jpeg(shown, kQuality)));
}

}  // namespace

std::string shown_images(const SequenceResult& sequence, std::size_t number) {
  std::string svg =
      fmt::format(R"(<svg class="hidden" width="0" height="0"><defs><g id="pair{}">)", number);
  add_image(svg, sequence.shown_left, 0);
  add_image(svg, sequence.shown_fisheye, shown_width(sequence.shown_left) + kGap);
  return svg + "</g></defs></svg>\n";
}

std::string match_chart(const SequenceResult& sequence, std::size_t number,
                        const MethodResult& method) {
  const int shift = shown_width(sequence.shown_left) + kGap;
  std::string svg = fmt::format(
      R"(<svg viewBox="0 0 {} {}" role="img" aria-label="matches of {}"><use href="#pair{}"/>)",
      shift + shown_width(sequence.shown_fisheye), kShownHeight, html_text(method.name), number);
  const double left_zoom = zoom_of(sequence.shown_left);
  const double fisheye_zoom = zoom_of(sequence.shown_fisheye);
  const std::size_t step = (method.shown.size() + kMostLines - 1) / kMostLines;
  for (const bool inlier : {false, true}) {  // inliers on top
    for (std::size_t i = 0; i < method.shown.size(); i += std::max<std::size_t>(step, 1)) {
      const ShownMatch& match = method.shown[i];
      if (match.inlier != inlier) continue;
      fmt::format_to(
          std::back_inserter(svg), R"(<path class="{}" d="M{:.1f} {:.1f}L{:.1f} {:.1f}"/>)",
          inlier ? "in" : "out", (match.left.x + 0.5) * left_zoom, (match.left.y + 0.5) * left_zoom,
          shift + (match.fisheye.x + 0.5) * fisheye_zoom, (match.fisheye.y + 0.5) * fisheye_zoom);
    }
  }
  return svg + "</svg>\n";
}

}  // namespace hybrid_slam
