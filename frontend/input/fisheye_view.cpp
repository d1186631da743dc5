#include "frontend/input/fisheye_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "frontend/input/image_file.h"

namespace hybrid_slam {
namespace {

constexpr double kRingWidth = 2;  // [px]
constexpr int kRingsAcross = 3;   // an edge is looked for between so many rings inside and outside
constexpr double kMinContrast = 6;   // grey levels between both sides of the circle's edge
constexpr double kMaxDeviation = 3;  // grey levels: how alike all is outside

// Distance of a pixel from the principal point in units of the focal length: theta_d.
double radius_of(const Calibrated<KannalaBrandt>& camera, double x, double y) {
  const auto& [fx, fy, cx, cy, k1, k2, k3, k4] = camera.params;
  return std::hypot((x - cx) / fx, (y - cy) / fy);
}

double mean_focal(const Calibrated<KannalaBrandt>& camera) {
  return KannalaBrandt::focal_length(camera.params.data());
}

// Median grey level of each ring around the principal point, as far as the image holds a tenth of
// it.
std::vector<double> ring_medians(const Calibrated<KannalaBrandt>& camera, const GrayImage& image) {
  std::vector<std::array<int, 256>> histograms;
  const double rings_per_unit = mean_focal(camera) / kRingWidth;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const auto ring = static_cast<std::size_t>(radius_of(camera, x, y) * rings_per_unit);
      if (ring >= histograms.size()) histograms.resize(ring + 1);
      ++histograms[ring][image.row(y)[x]];
    }
  }
  std::vector<double> medians;
  for (const auto& histogram : histograms) {
    int total = 0;
    for (const int count : histogram) total += count;
    const double whole = 2 * std::numbers::pi * kRingWidth * kRingWidth *
                         (static_cast<double>(medians.size()) + 0.5);
    if (total < 0.1 * whole) break;
    int below = 0;
    int level = 0;
    while (level < 255 && 2 * (below + histogram[static_cast<std::size_t>(level)]) < total) {
      below += histogram[static_cast<std::size_t>(level++)];
    }
    medians.push_back(level);
  }
  return medians;
}

// The largest angle of the model as a distance from the principal point [px].
double fold_radius(const Calibrated<KannalaBrandt>& camera) {
  const double angle = KannalaBrandt::max_angle(camera.params.data());
  const double w = angle * angle;
  const auto& k = camera.params;
  return mean_focal(camera) * angle * (1 + w * (k[4] + w * (k[5] + w * (k[6] + w * k[7]))));
}

double radius_at(const Calibrated<KannalaBrandt>& camera, double angle) {
  const double bounded = std::min(angle, KannalaBrandt::max_angle(camera.params.data()));
  const Eigen::Vector3d ray(std::sin(bounded), 0, std::cos(bounded));
  std::array<double, 2> pixel{};
  if (!KannalaBrandt::project<double>(camera.params.data(), ray.data(), pixel.data())) return 0;
  return mean_focal(camera) * radius_of(camera, pixel[0], pixel[1]);
}

// Median of the circles found, if most of the examples show one.
std::optional<double> common_circle(const Calibrated<KannalaBrandt>& camera,
                                    std::span<const GrayImage> examples) {
  std::vector<double> found;
  for (const GrayImage& image : examples) {
    if (const auto radius = find_image_circle(camera, image)) found.push_back(*radius);
  }
  if (found.empty() || 2 * found.size() < examples.size()) return std::nullopt;
  const auto middle = found.begin() + static_cast<long>(found.size() / 2);
  std::nth_element(found.begin(), middle, found.end());
  return *middle;
}

double visible_radius(const Calibrated<KannalaBrandt>& camera, std::span<const GrayImage> examples,
                      const FisheyeViewOptions& options) {
  const double fold = fold_radius(camera);
  if (options.max_angle_deg > 0) {
    return radius_at(camera, options.max_angle_deg * std::numbers::pi / 180);
  }
  const auto circle = common_circle(camera, examples);
  if (!circle) return fold;
  constexpr double kTolerance = 0.9;
  if (fold < kTolerance * *circle) {
    throw InputError("fisheye calibration: k1 to k4: the field of view folds " +
                     std::to_string(std::lround(fold)) +
                     " px from the principal point, within the image circle of radius " +
                     std::to_string(std::lround(*circle)) + " px");
  }
  return std::min(fold, *circle);
}

}  // namespace

std::string FisheyeViewOptions::validate() const {
  if (!(max_angle_deg >= 0 && max_angle_deg <= 180)) {
    return "fisheye: max_angle_deg must lie in [0, 180]";
  }
  if (!(border >= 0)) return "fisheye: border must not be negative";
  if (!(clahe >= 0)) return "fisheye: clahe must not be negative";
  return {};
}

std::optional<double> find_image_circle(const Calibrated<KannalaBrandt>& camera,
                                        const GrayImage& image) {
  const std::vector<double> medians = ring_medians(camera, image);
  const int rings = static_cast<int>(medians.size());
  if (rings < 8 * kRingsAcross) return std::nullopt;
  const double outside = medians.back();
  // From the outside in, as long as all is alike.
  int edge = rings;
  while (edge > 0 &&
         std::abs(medians[static_cast<std::size_t>(edge - 1)] - outside) <= kMaxDeviation) {
    --edge;
  }
  const int inside = edge - kRingsAcross;
  if (inside < 0 || rings - edge < kRingsAcross ||
      medians[static_cast<std::size_t>(inside)] < outside + kMinContrast) {
    return std::nullopt;
  }
  // The edge itself is where half of the step is done.
  const double half = 0.5 * (medians[static_cast<std::size_t>(inside)] + outside);
  while (edge > 0 && medians[static_cast<std::size_t>(edge - 1)] < half) --edge;
  return edge * kRingWidth;
}

GrayImage make_fisheye_mask(const Calibrated<KannalaBrandt>& camera,
                            std::span<const GrayImage> examples,
                            const FisheyeViewOptions& options) {
  GrayImage mask;
  if (options.mask.empty()) {
    mask = {camera.width, camera.height, {}};
    mask.pixels.assign(
        static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), 255);
  } else {
    mask = read_gray_image(options.mask, {camera.width, camera.height});
  }
  const double radius = visible_radius(camera, examples, options) - options.border;
  const double focal = mean_focal(camera);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (!(focal * radius_of(camera, x, y) <= radius)) mask.row(y)[x] = 0;
    }
  }
  return mask;
}

void enhance_contrast(GrayImage& image, double clip) {
  cv::Mat pixels(image.height, image.width, CV_8UC1, image.pixels.data());
  cv::createCLAHE(clip, cv::Size(8, 8))->apply(pixels.clone(), pixels);
}

}  // namespace hybrid_slam
