#include "apps/report/coverage.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kOutside = 0.02;    // share of the landmarks beyond either end of either axis
constexpr double kNearOrFar = 0.05;  // share of a keyframe's landmarks at either end
constexpr int kCells = 160;          // along the longer side, at most
constexpr std::size_t kFewest = 10;  // landmarks that tell a plane
constexpr int kSubCell = 8;          // bits of a cell's fraction in OpenCV's drawing
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

struct Range {
  double low = 0;
  double high = 0;
  double size() const { return high - low; }
};

Range most_of(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& axis) {
  std::vector<double> values;
  for (const Eigen::Vector3d& point : points) values.push_back(axis.dot(point));
  return {quantile(values, kOutside), quantile(values, 1 - kOutside)};
}

// Those within most_of() along each axis of the world: far points would turn the plane.
std::vector<Eigen::Vector3d> inner_points(const MapFigures& figures) {
  std::vector<Eigen::Vector3d> points;
  for (const LandmarkFigures& landmark : figures.landmarks) points.push_back(landmark.point);
  std::vector<Eigen::Vector3d> inner;
  std::array<Range, 3> ranges;
  for (int i = 0; i < 3; ++i) {
    ranges[static_cast<std::size_t>(i)] = most_of(points, Eigen::Vector3d::Unit(i));
  }
  for (const Eigen::Vector3d& point : points) {
    bool inside = true;
    for (int i = 0; i < 3; ++i) {
      const Range& range = ranges[static_cast<std::size_t>(i)];
      inside = inside && point[i] >= range.low && point[i] <= range.high;
    }
    if (inside) inner.push_back(point);
  }
  return inner;
}

// First axis: the camera's x, as far as it lies in the plane, so that what the first camera has on
// the right is on the right. The normal points to the cameras.
Eigen::Matrix3d plane_axes(const std::vector<Eigen::Vector3d>& points, const MapFigures& figures) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) {
    spread += (point - mean) * (point - mean).transpose();
  }
  Eigen::Vector3d normal =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  double side = 0;
  for (const KeyframeFigures& keyframe : figures.keyframes) {
    side += normal.dot(keyframe.world_from_cam.translation() - mean);
  }
  if (side < 0) normal = -normal;
  const Eigen::Vector3d along =
      std::abs(normal.x()) < 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d right = (along - along.dot(normal) * normal).normalized();
  Eigen::Matrix3d axes;
  axes << right.transpose(), normal.cross(right).transpose(), normal.transpose();
  return axes;
}

// 1, 2 or 5 times a power of ten, at least `length`.
double round_up(double length) {
  const double power = std::pow(10, std::floor(std::log10(length)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (step * power >= length) return step * power;
  }
  return 10 * power;
}

// The landmarks that a keyframe sees, without the nearest and the farthest.
std::vector<Eigen::Vector3d> ground_of(const MapFigures& figures, const KeyframeFigures& keyframe) {
  const auto distance = [&](std::uint32_t landmark) {
    return (figures.landmarks[landmark].point - keyframe.world_from_cam.translation()).norm();
  };
  std::vector<double> distances;
  for (const std::uint32_t landmark : keyframe.seen) distances.push_back(distance(landmark));
  const double nearest = quantile(distances, kNearOrFar);
  const double farthest = quantile(distances, 1 - kNearOrFar);
  std::vector<Eigen::Vector3d> points;
  for (const std::uint32_t landmark : keyframe.seen) {
    const double away = distance(landmark);
    if (away >= nearest && away <= farthest) points.push_back(figures.landmarks[landmark].point);
  }
  return points;
}

// From one end of the footprints to the other, but no farther beyond most of the landmarks than
// half of what these cover: a keyframe may see little else than what is far off.
Range ground_range(const MapFigures& figures, const std::vector<Eigen::Vector3d>& points,
                   const Eigen::Vector3d& axis) {
  Range range = most_of(points, axis);
  const double margin = 0.5 * range.size();
  const Range widest{range.low - margin, range.high + margin};
  for (const KeyframeFigures& keyframe : figures.keyframes) {
    for (const Eigen::Vector3d& point : ground_of(figures, keyframe)) {
      const double at = std::clamp(axis.dot(point), widest.low, widest.high);
      range.low = std::min(range.low, at);
      range.high = std::max(range.high, at);
    }
  }
  return range;
}

void lay_out(Coverage& coverage, const MapFigures& figures,
             const std::vector<Eigen::Vector3d>& points) {
  const Range right = ground_range(figures, points, coverage.axes.row(0));
  const Range up = ground_range(figures, points, coverage.axes.row(1));
  const Range height = most_of(points, coverage.axes.row(2));
  coverage.cell = round_up(std::max({right.size(), up.size(), 1e-6}) / kCells);
  coverage.corner = {std::floor(right.low / coverage.cell) * coverage.cell,
                     std::floor(up.low / coverage.cell) * coverage.cell};
  coverage.columns = std::max(1, static_cast<int>(std::ceil(right.size() / coverage.cell)) + 1);
  coverage.rows = std::max(1, static_cast<int>(std::ceil(up.size() / coverage.cell)) + 1);
  coverage.height = 0.5 * (height.low + height.high);
  const auto cells = static_cast<std::size_t>(coverage.columns * coverage.rows);
  coverage.stereo_views.assign(cells, 0);
  coverage.fisheye_views.assign(cells, 0);
  coverage.resolution.assign(cells, kNone);
  coverage.sigma.assign(cells, kNone);
}

Eigen::Vector2d in_cells(const Coverage& coverage, const Eigen::Vector3d& point) {
  return ((coverage.axes * point).head<2>() - coverage.corner) / coverage.cell;
}

// Corners in cells, times 2^kSubCell, the middle of the first cell at 0.
std::vector<cv::Point> footprint(const Coverage& coverage, const MapFigures& figures,
                                 const KeyframeFigures& keyframe) {
  std::vector<cv::Point> points;
  for (const Eigen::Vector3d& point : ground_of(figures, keyframe)) {
    const Eigen::Vector2d at = (in_cells(coverage, point).array() - 0.5) * (1 << kSubCell);
    const double limit = 1e8;  // OpenCV's drawing counts in int
    points.emplace_back(static_cast<int>(std::clamp(at.x(), -limit, limit)),
                        static_cast<int>(std::clamp(at.y(), -limit, limit)));
  }
  std::vector<cv::Point> hull;
  if (points.size() >= 3) cv::convexHull(points, hull);
  return hull;
}

void add_footprint(Coverage& coverage, const MapFigures& figures, const KeyframeFigures& keyframe) {
  const std::vector<cv::Point> hull = footprint(coverage, figures, keyframe);
  if (hull.size() < 3) return;
  cv::Mat mask(coverage.rows, coverage.columns, CV_8UC1, cv::Scalar(0));
  cv::fillConvexPoly(mask, hull, cv::Scalar(1), cv::LINE_8, kSubCell);
  auto& views = keyframe.stereo ? coverage.stereo_views : coverage.fisheye_views;
  const auto resolution = static_cast<float>(keyframe.resolution);
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (mask.data[i] == 0) continue;
    if (views[i] < 65535) ++views[i];
    if (!(coverage.resolution[i] <= resolution)) coverage.resolution[i] = resolution;
  }
}

void add_sigmas(Coverage& coverage, const MapFigures& figures) {
  std::vector<std::vector<double>> sigmas(coverage.sigma.size());
  for (const LandmarkFigures& landmark : figures.landmarks) {
    const Eigen::Vector2d at = in_cells(coverage, landmark.point);
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() < coverage.columns && at.y() < coverage.rows)) {
      continue;
    }
    sigmas[static_cast<std::size_t>(static_cast<int>(at.y()) * coverage.columns +
                                    static_cast<int>(at.x()))]
        .push_back(1e3 * landmark.sigma);
  }
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    const double median = quantile(sigmas[i], 0.5);
    if (std::isfinite(median)) coverage.sigma[i] = static_cast<float>(median);
  }
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

}  // namespace

Coverage find_coverage(const MapFigures& figures) {
  Coverage coverage;
  const std::vector<Eigen::Vector3d> points = inner_points(figures);
  if (points.size() < kFewest) return coverage;
  coverage.axes = plane_axes(points, figures);
  lay_out(coverage, figures, points);
  for (const KeyframeFigures& keyframe : figures.keyframes) {
    add_footprint(coverage, figures, keyframe);
  }
  add_sigmas(coverage, figures);
  return coverage;
}

Json to_json(const Coverage& coverage, const MapFigures& figures) {
  if (coverage.empty()) return Json();
  std::size_t seen = 0, once = 0, stereo = 0, fisheye = 0;
  std::vector<double> resolutions, distances;
  for (std::size_t i = 0; i < coverage.resolution.size(); ++i) {
    const int views = coverage.stereo_views[i] + coverage.fisheye_views[i];
    if (views == 0) continue;
    ++seen;
    if (views == 1) ++once;
    if (coverage.stereo_views[i] > 0) ++stereo;
    if (coverage.fisheye_views[i] > 0) ++fisheye;
    resolutions.push_back(coverage.resolution[i]);
  }
  for (const KeyframeFigures& keyframe : figures.keyframes) {
    if (keyframe.stereo && std::isfinite(keyframe.distance)) {
      distances.push_back(keyframe.distance);
    }
  }
  const double area = coverage.cell * coverage.cell;
  const auto share = [&](std::size_t of) {
    return seen > 0 ? static_cast<double>(of) / static_cast<double>(seen) : 0.0;
  };
  return {{"area_m2", area * static_cast<double>(seen)},
          {"stereo_area_m2", area * static_cast<double>(stereo)},
          {"fisheye_area_m2", area * static_cast<double>(fisheye)},
          {"seen_once_share", share(once)},
          {"cell_m", coverage.cell},
          {"resolution_mm_per_px", number(quantile(resolutions, 0.5))},
          {"distance_m", number(quantile(distances, 0.5))}};
}

void write_coverage(const std::filesystem::path& path, const Coverage& coverage) {
  std::string text =
      "column,row,right_m,up_m,stereo_views,fisheye_views,resolution_mm_per_px,sigma_mm\n";
  for (std::size_t i = 0; i < coverage.resolution.size(); ++i) {
    if (coverage.stereo_views[i] + coverage.fisheye_views[i] == 0) continue;
    const int column = static_cast<int>(i) % coverage.columns;
    const int row = static_cast<int>(i) / coverage.columns;
    const bool known = std::isfinite(coverage.sigma[i]);
    text += fmt::format("{},{},{:.6g},{:.6g},{},{},{:.5g},{}\n", column, row,
                        coverage.corner.x() + (column + 0.5) * coverage.cell,
                        coverage.corner.y() + (row + 0.5) * coverage.cell, coverage.stereo_views[i],
                        coverage.fisheye_views[i], coverage.resolution[i],
                        known ? fmt::format("{:.4g}", coverage.sigma[i]) : std::string());
  }
  write_file(path, text);
}

}  // namespace hybrid_slam
