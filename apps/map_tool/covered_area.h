#pragma once

#include <span>

#include <Eigen/Core>

namespace hybrid_slam {

// How much ground points cover, seen along the normal of the plane through them (their two longest
// principal axes).
struct CoveredArea {
  double hull = 0;       // of their convex hull [m^2]
  double footprint = 0;  // of the square cells that hold a point [m^2]
  double cell = 0;       // their side [m]
  double length = 0;     // extent along the longest axis [m]
  double width = 0;      // and along the next one
};

CoveredArea covered_area(std::span<const Eigen::Vector3d> points, double cell);

}  // namespace hybrid_slam
