#include "test/frontend/features/sift_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <set>
#include <stdexcept>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/matching/brute_force.h"

namespace hybrid_slam {
namespace {

constexpr double kRatio = 0.8;
constexpr double kRepeatDistance = 1.5;  // [px of the coarser image]
constexpr double kMatchDistance = 2.5;   // [px of the coarser image]
constexpr double kScaleRatio = 1.3;

struct Warp {
  std::string kind;
  double turn_deg = 0;
  double scale = 1;
  double tilt = 0;   // change of size across the image
  double blur = 0;   // standard deviation [px]
  double noise = 0;  // standard deviation [grey levels]
  double contrast = 1;
};

const std::vector<Warp>& warps() {
  static const std::vector<Warp> kWarps = {
      {.kind = "turned by 20 deg", .turn_deg = 20},
      {.kind = "turned by 135 deg", .turn_deg = 135},
      {.kind = "scaled by 0.5", .turn_deg = 5, .scale = 0.5},
      {.kind = "scaled by 0.75", .turn_deg = -10, .scale = 0.75},
      {.kind = "scaled by 1.4", .turn_deg = 10, .scale = 1.4},
      {.kind = "scaled by 2", .turn_deg = -5, .scale = 2},
      {.kind = "tilted", .turn_deg = 15, .scale = 0.9, .tilt = 0.35},
      {.kind = "blurred", .turn_deg = 7, .blur = 1.2},
      {.kind = "noisy", .turn_deg = -7, .noise = 6},
      {.kind = "of less contrast", .turn_deg = 12, .contrast = 0.55},
  };
  return kWarps;
}

cv::Mat homography(const Warp& warp, const cv::Size& size, cv::Size* target) {
  *target = cv::Size(static_cast<int>(std::lround(size.width * warp.scale)),
                     static_cast<int>(std::lround(size.height * warp.scale)));
  const double angle = warp.turn_deg * std::numbers::pi / 180;
  const double c = warp.scale * std::cos(angle);
  const double s = warp.scale * std::sin(angle);
  const cv::Matx33d centre(1, 0, -(size.width - 1) / 2.0, 0, 1, -(size.height - 1) / 2.0, 0, 0, 1);
  const cv::Matx33d turn(c, -s, 0, s, c, 0, warp.tilt / size.width, warp.tilt / size.height / 2, 1);
  const cv::Matx33d back(1, 0, (target->width - 1) / 2.0, 0, 1, (target->height - 1) / 2.0, 0, 0,
                         1);
  return cv::Mat(back * turn * centre);
}

// Blurred before it is made smaller, so that nothing aliases.
cv::Mat warped(const cv::Mat& image, const Warp& warp, const cv::Mat& second_from_first,
               const cv::Size& size, int seed) {
  cv::Mat source;
  image.convertTo(source, CV_32F);
  if (warp.scale < 1) {
    cv::GaussianBlur(source, source, {}, 0.5 * std::sqrt(1 / (warp.scale * warp.scale) - 1));
  }
  cv::Mat result;
  cv::warpPerspective(source, result, second_from_first, size, cv::INTER_CUBIC,
                      cv::BORDER_REFLECT_101);
  if (warp.blur > 0) cv::GaussianBlur(result, result, {}, warp.blur);
  result = (result - 128) * warp.contrast + 128;
  if (warp.noise > 0) {
    cv::Mat noise(result.size(), CV_32F);
    cv::RNG(static_cast<std::uint64_t>(seed)).fill(noise, cv::RNG::NORMAL, 0, warp.noise);
    result += noise;
  }
  result.convertTo(result, CV_8U);
  return result;
}

GrayImage to_image(const cv::Mat& mat) {
  GrayImage image{mat.cols, mat.rows, {}};
  for (int y = 0; y < mat.rows; ++y) {
    image.pixels.insert(image.pixels.end(), mat.ptr(y), mat.ptr(y) + mat.cols);
  }
  return image;
}

GrayImage load(const std::string& path) {
  const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (image.empty()) throw std::runtime_error("cannot read " + path);
  return to_image(image);
}

// Where a feature of the first image lies in the second, and its scale there.
struct Place {
  double x, y, scale;
};

Place mapped(const cv::Mat& h, const Keypoint& k) {
  const auto at = [&](int row, int column) { return h.at<double>(row, column); };
  const double w = at(2, 0) * k.x + at(2, 1) * k.y + at(2, 2);
  const double x = (at(0, 0) * k.x + at(0, 1) * k.y + at(0, 2)) / w;
  const double y = (at(1, 0) * k.x + at(1, 1) * k.y + at(1, 2)) / w;
  const double xx = (at(0, 0) - x * at(2, 0)) / w, xy = (at(0, 1) - x * at(2, 1)) / w;
  const double yx = (at(1, 0) - y * at(2, 0)) / w, yy = (at(1, 1) - y * at(2, 1)) / w;
  return {x, y, k.scale * std::sqrt(std::abs(xx * yy - xy * yx))};
}

double distance(const Place& place, const Keypoint& k) {
  return std::hypot(place.x - k.x, place.y - k.y);
}

bool repeats(const Place& place, const FeatureSet& features, double radius) {
  return std::any_of(features.keypoints.begin(), features.keypoints.end(), [&](const Keypoint& k) {
    const double ratio = k.scale / place.scale;
    return distance(place, k) <= radius && ratio < kScaleRatio && ratio > 1 / kScaleRatio;
  });
}

PairQuality compare(const FeatureSet& first, const FeatureSet& second, const cv::Mat& h,
                    const cv::Size& size, double scale) {
  PairQuality quality;
  quality.features = static_cast<double>(first.size() + second.size());
  const double unit = std::max(1.0, scale);
  std::set<std::pair<float, float>> seen;  // several angles are one place
  for (const Keypoint& k : first.keypoints) {
    if (!seen.insert({k.x, k.y}).second) continue;
    const Place place = mapped(h, k);
    if (place.x < 8 || place.y < 8 || place.x > size.width - 9 || place.y > size.height - 9)
      continue;
    ++quality.visible;
    quality.repeated += repeats(place, second, unit * kRepeatDistance);
  }
  BruteForceOptions options;
  options.ratio = kRatio;
  options.mutual = false;
  options.max_descriptor_distance = 2;
  for (const DescriptorMatch& match : match_brute_force(first, second, options)) {
    const Place place = mapped(h, first.keypoints[static_cast<std::size_t>(match.query)]);
    const double error = distance(place, second.keypoints[static_cast<std::size_t>(match.train)]);
    ++quality.matches;
    if (error > unit * kMatchDistance) continue;
    ++quality.correct;
    quality.error += error / unit;
  }
  return quality;
}

std::vector<std::string> images_below(const std::string& folder, int count) {
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".jpg" || extension == ".png") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<std::string> chosen;
  for (int i = 0; i < count && !paths.empty(); ++i) {
    chosen.push_back(
        paths[static_cast<std::size_t>(i) * paths.size() / static_cast<std::size_t>(count)]);
  }
  return chosen;
}

}  // namespace

PairQuality& PairQuality::operator+=(const PairQuality& other) {
  features += other.features;
  visible += other.visible;
  repeated += other.repeated;
  matches += other.matches;
  correct += other.correct;
  error += other.error;
  return *this;
}

std::vector<QualityRow> warped_copies(SiftExtractor& sift, const std::string& folder, int count) {
  std::vector<QualityRow> rows;
  for (const Warp& warp : warps()) rows.push_back({warp.kind, 0, {}});
  int seed = 0;
  for (const std::string& path : images_below(folder, count)) {
    const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
    if (image.empty()) throw std::runtime_error("cannot read " + path);
    const FeatureSet first = sift.extract(to_image(image), nullptr);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      cv::Size size;
      const cv::Mat h = homography(warps()[i], image.size(), &size);
      const cv::Mat copy = warped(image, warps()[i], h, size, ++seed);
      const FeatureSet second = sift.extract(to_image(copy), nullptr);
      rows[i].sum += compare(first, second, h, size, warps()[i].scale);
      ++rows[i].pairs;
    }
  }
  return rows;
}

QualityRow stereo_pairs(SiftExtractor& sift, const std::string& folder, int step) {
  QualityRow row{"stereo", 0, {}};
  BruteForceOptions options;
  options.ratio = kRatio;
  options.mutual = false;
  options.max_descriptor_distance = 2;
  for (int i = 0;; i += step) {
    const std::string path = folder + "/images/raw/" + std::to_string(i);
    if (!std::filesystem::exists(path + "_left.jpg")) break;
    const FeatureSet left = sift.extract(load(path + "_left.jpg"), nullptr);
    const FeatureSet right = sift.extract(load(path + "_right.jpg"), nullptr);
    row.sum.features += static_cast<double>(left.size() + right.size());
    for (const DescriptorMatch& match : match_brute_force(left, right, options)) {
      const Keypoint& l = left.keypoints[static_cast<std::size_t>(match.query)];
      const Keypoint& r = right.keypoints[static_cast<std::size_t>(match.train)];
      ++row.sum.matches;
      if (std::abs(l.y - r.y) > 1 || l.x <= r.x) continue;
      ++row.sum.correct;
      row.sum.error += std::abs(l.y - r.y);
    }
    ++row.pairs;
  }
  return row;
}

}  // namespace hybrid_slam
