#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

struct ColoredPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // [m]
  std::array<std::uint8_t, 3> rgb{};
};

// PLY, binary little endian: x y z as float, red green blue as uchar. Throws OutputError.
void write_ply(const std::filesystem::path& path, std::span<const ColoredPoint> points);

// Landmarks, then the positions of the keyframes; world frame. Stereo: landmarks in grey, keyframes
// in red; fisheye: landmarks in violet, keyframes in blue. A landmark counts for the camera that
// found it.
void write_map_ply(const std::filesystem::path& path, const MapSnapshot& map);

// Positions in the map by the kind of camera: of landmarks by who found them, ascending by id.
struct MapPositions {
  std::vector<Eigen::Vector3d> landmarks;
  std::vector<Eigen::Vector3d> keyframes;
};
MapPositions stereo_positions(const MapSnapshot& map);
MapPositions fisheye_positions(const MapSnapshot& map);

}  // namespace hybrid_slam
