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

// Landmarks in grey, then the positions of the keyframes in red; world frame.
void write_map_ply(const std::filesystem::path& path, const MapSnapshot& map);

// Positions of all landmarks, ascending by id.
std::vector<Eigen::Vector3d> landmark_positions(const MapSnapshot& map);

}  // namespace hybrid_slam
