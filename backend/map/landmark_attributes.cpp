#include "backend/map/landmark_attributes.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace hybrid_slam {

namespace {

constexpr std::size_t kMaxCompared = 8;

int squared_distance(const Descriptor& a, const Descriptor& b) {
  int sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    // 16 bits: what the compiler can multiply and add pairwise.
    const auto difference = static_cast<std::int16_t>(a[i] - b[i]);
    sum += difference * difference;
  }
  return sum;
}

const FrameObservations& frame_of(const MapTables& tables, KeyframeId id) {
  return *tables.keyframes.find(id.value)->observations;
}

}  // namespace

void update_appearance(const MapTables& tables, Landmark& landmark) {
  const std::size_t total = landmark.observations.size();
  const std::size_t count = std::min(total, kMaxCompared);
  std::array<const Descriptor*, kMaxCompared> seen{};
  for (std::size_t i = 0; i < count; ++i) {
    const Observation& o = landmark.observations[i * total / count];
    seen[i] = &frame_of(tables, o.keyframe).features.descriptors[o.keypoint];
  }
  std::array<std::array<int, kMaxCompared>, kMaxCompared> distance{};
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      distance[i][j] = distance[j][i] = squared_distance(*seen[i], *seen[j]);
    }
  }
  std::size_t best = 0;
  int least_median = -1;
  for (std::size_t i = 0; i < count; ++i) {
    auto& row = distance[i];
    const auto middle = row.begin() + static_cast<std::ptrdiff_t>((count - 1) / 2);
    std::nth_element(row.begin(), middle, row.begin() + static_cast<std::ptrdiff_t>(count));
    if (least_median < 0 || *middle < least_median) {
      least_median = *middle;
      best = i;
    }
  }
  landmark.descriptor = *seen[best];
}

void update_geometry(const MapTables& tables, Landmark& landmark) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Observation& observation : landmark.observations) {
    const Keyframe& keyframe = *tables.keyframes.find(observation.keyframe.value);
    const Eigen::Vector3d ray = landmark.point_in_world - origin_in_a(keyframe.cam_from_world);
    sum += ray.normalized();
    if (observation.keyframe == landmark.reference) {
      const FrameObservations& frame = *keyframe.observations;
      const double scale = frame.features.keypoints[observation.keypoint].scale;
      landmark.object_scale = scale / focal_length(tables.cameras[frame.camera.value]) * ray.norm();
    }
  }
  landmark.mean_direction = sum.normalized();
}

bool is_supported(const MapTables& tables, const Landmark& landmark) {
  if (landmark.observations.size() != 1) return landmark.observations.size() > 1;
  const Observation& only = landmark.observations.front();
  return frame_of(tables, only.keyframe).has_right(only.keypoint);
}

}  // namespace hybrid_slam
