#include "apps/io/ply.h"

#include <bit>
#include <cstring>
#include <string>

#include "cameras/output_file.h"

namespace hybrid_slam {

namespace {

static_assert(std::endian::native == std::endian::little, "the file is written as memory has it");

constexpr std::array<std::uint8_t, 3> kLandmarkColor{190, 190, 190};
constexpr std::array<std::uint8_t, 3> kKeyframeColor{220, 40, 30};

}  // namespace

void write_ply(const std::filesystem::path& path, std::span<const ColoredPoint> points) {
  std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                     std::to_string(points.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\n"
                     "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
  for (const ColoredPoint& point : points) {
    const Eigen::Vector3f position = point.point.cast<float>();
    char record[15];
    std::memcpy(record, position.data(), 12);
    std::memcpy(record + 12, point.rgb.data(), 3);
    text.append(record, sizeof(record));
  }
  write_file(path, text);
}

std::vector<Eigen::Vector3d> landmark_positions(const MapSnapshot& map) {
  std::vector<Eigen::Vector3d> positions;
  for (const LandmarkId id : map.landmark_ids()) positions.push_back(map.at(id).point_in_world);
  return positions;
}

void write_map_ply(const std::filesystem::path& path, const MapSnapshot& map) {
  std::vector<ColoredPoint> points;
  for (const Eigen::Vector3d& position : landmark_positions(map)) {
    points.push_back({position, kLandmarkColor});
  }
  for (const KeyframeId id : map.keyframe_ids()) {
    points.push_back({origin_in_a(map.at(id).cam_from_world), kKeyframeColor});
  }
  write_ply(path, points);
}

}  // namespace hybrid_slam
