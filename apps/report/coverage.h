#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "apps/report/map_figures.h"

namespace hybrid_slam {

// The ground as the map has it: cells of a plane, how often each was seen and how well. The plane
// is that along which the landmarks spread most; its normal points to the cameras. The footprint of
// a keyframe is the convex hull, in the plane, of the landmarks that it sees, the nearest and the
// farthest 5 % left out.
struct Coverage {
  // Rows: the plane's two axes and its normal, in the world. plane = axes * world.
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  double cell = 0;                                   // size of a cell [m]
  Eigen::Vector2d corner = Eigen::Vector2d::Zero();  // of the first cell, in the plane [m]
  double height = 0;                                 // of the plane along the normal [m]
  int columns = 0;
  int rows = 0;
  // Of each cell, row by row.
  std::vector<std::uint16_t> stereo_views;   // footprints of stereo keyframes that hold its middle
  std::vector<std::uint16_t> fisheye_views;  // likewise
  std::vector<float> resolution;             // finest of them [mm/px]; NaN where there are none
  std::vector<float> sigma;                  // median of its landmarks' sigma [mm]; NaN likewise

  bool empty() const { return columns == 0; }
};

// Empty where a map has too few landmarks to tell a plane.
Coverage find_coverage(const MapFigures& figures);

// For summary.json, "coverage": what of the ground stereo pair and fisheye saw, and what of it once
// only.
nlohmann::ordered_json to_json(const Coverage& coverage, const MapFigures& figures);

// coverage.csv: the cells that were seen. Throws OutputError.
void write_coverage(const std::filesystem::path& path, const Coverage& coverage);

}  // namespace hybrid_slam
