#include "apps/map_tool/covered_area.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

namespace hybrid_slam {
namespace {

double cross(const Eigen::Vector2d& o, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return (a - o).x() * (b - o).y() - (a - o).y() * (b - o).x();
}

// Andrew's monotone chain: the hull's corners, anticlockwise.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y());
  });
  std::vector<Eigen::Vector2d> hull;
  const auto half = [&](auto begin, auto end) {
    const std::size_t first = hull.size();
    for (auto point = begin; point != end; ++point) {
      while (hull.size() >= first + 2 && cross(hull[hull.size() - 2], hull.back(), *point) <= 0) {
        hull.pop_back();
      }
      hull.push_back(*point);
    }
    hull.pop_back();  // the other half begins with it
  };
  half(points.begin(), points.end());
  half(points.rbegin(), points.rend());
  return hull;
}

double area_of(const std::vector<Eigen::Vector2d>& corners) {
  double twice = 0;
  for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
    twice += cross(corners.front(), corners[i], corners[i + 1]);
  }
  return 0.5 * twice;
}

}  // namespace

CoveredArea covered_area(std::span<const Eigen::Vector3d> points, double cell) {
  CoveredArea area;
  area.cell = cell;
  if (points.size() < 3 || !(cell > 0)) return area;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) spread += (point - mean) * (point - mean).transpose();
  const Eigen::Matrix3d axes =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors();
  std::vector<Eigen::Vector2d> flat;  // eigenvalues ascend: the last two columns span the plane
  std::set<std::pair<long long, long long>> cells;
  Eigen::Vector2d least(INFINITY, INFINITY);
  Eigen::Vector2d most(-INFINITY, -INFINITY);
  for (const Eigen::Vector3d& point : points) {
    flat.emplace_back(axes.col(2).dot(point - mean), axes.col(1).dot(point - mean));
    cells.emplace(std::llround(std::floor(flat.back().x() / cell)),
                  std::llround(std::floor(flat.back().y() / cell)));
    least = least.cwiseMin(flat.back());
    most = most.cwiseMax(flat.back());
  }
  area.length = (most - least).x();
  area.width = (most - least).y();
  area.footprint = static_cast<double>(cells.size()) * cell * cell;
  area.hull = area_of(convex_hull(std::move(flat)));
  return area;
}

}  // namespace hybrid_slam
