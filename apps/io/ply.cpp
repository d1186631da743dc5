#include "apps/io/ply.h"

#include <bit>
#include <cstring>
#include <string>

#include "cameras/files/output_file.h"

namespace hybrid_slam {

namespace {

static_assert(std::endian::native == std::endian::little, "the file is written as memory has it");

constexpr std::array<std::uint8_t, 3> kLandmarkColor{190, 190, 190};
constexpr std::array<std::uint8_t, 3> kKeyframeColor{220, 40, 30};
constexpr std::array<std::uint8_t, 3> kFisheyeLandmarkColor{190, 120, 210};
constexpr std::array<std::uint8_t, 3> kFisheyeKeyframeColor{40, 60, 220};

MapPositions positions_of(const MapSnapshot& map, bool stereo) {
  const auto seen_by = [&](KeyframeId id) { return baseline(map.camera(map.at(id))) > 0; };
  MapPositions positions;
  for (const LandmarkId id : map.landmark_ids()) {
    const Landmark& landmark = map.at(id);
    if (seen_by(landmark.reference) == stereo)
      positions.landmarks.push_back(landmark.point_in_world);
  }
  for (const KeyframeId id : map.keyframe_ids()) {
    if (seen_by(id) == stereo)
      positions.keyframes.push_back(origin_in_a(map.at(id).cam_from_world));
  }
  return positions;
}

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

MapPositions stereo_positions(const MapSnapshot& map) { return positions_of(map, true); }

MapPositions fisheye_positions(const MapSnapshot& map) { return positions_of(map, false); }

void write_map_ply(const std::filesystem::path& path, const MapSnapshot& map) {
  std::vector<ColoredPoint> points;
  const auto add = [&](const std::vector<Eigen::Vector3d>& positions, const auto& color) {
    for (const Eigen::Vector3d& position : positions) points.push_back({position, color});
  };
  const MapPositions stereo = stereo_positions(map);
  const MapPositions fisheye = fisheye_positions(map);
  add(stereo.landmarks, kLandmarkColor);
  add(fisheye.landmarks, kFisheyeLandmarkColor);
  add(stereo.keyframes, kKeyframeColor);
  add(fisheye.keyframes, kFisheyeKeyframeColor);
  write_ply(path, points);
}

}  // namespace hybrid_slam
