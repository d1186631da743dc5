#include "backend/map/landmark_attributes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

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

Eigen::Vector3d center_of(const MapTables& tables, KeyframeId id) {
  return origin_in_a(tables.keyframes.find(id.value)->cam_from_world);
}

template <typename CenterOf>
void update_geometry(const MapTables& tables, Landmark& landmark, CenterOf&& center) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Observation& observation : landmark.observations) {
    const Eigen::Vector3d ray = landmark.point_in_world - center(observation.keyframe);
    sum += ray.normalized();
    if (observation.keyframe == landmark.reference) {
      const FrameObservations& frame = frame_of(tables, observation.keyframe);
      const double scale = frame.features.keypoints[observation.keypoint].scale;
      landmark.object_scale = scale / focal_length(tables.cameras[frame.camera.value]) * ray.norm();
    }
  }
  landmark.mean_direction = sum.normalized();
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

CameraCenters::CameraCenters(const MapTables& tables)
    : tables_(tables),
      centers_(tables.next_keyframe,
               Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())) {}

const Eigen::Vector3d& CameraCenters::of(KeyframeId id) {
  Eigen::Vector3d& center = centers_[id.value];
  if (std::isnan(center.x())) center = center_of(tables_, id);
  return center;
}

void update_geometry(const MapTables& tables, Landmark& landmark) {
  update_geometry(tables, landmark, [&](KeyframeId id) { return center_of(tables, id); });
}

void update_geometry(const MapTables& tables, CameraCenters& centers, Landmark& landmark) {
  update_geometry(tables, landmark,
                  [&](KeyframeId id) -> const Eigen::Vector3d& { return centers.of(id); });
}

bool is_supported(const MapTables& tables, const Landmark& landmark) {
  if (landmark.observations.size() != 1) return landmark.observations.size() > 1;
  const Observation& only = landmark.observations.front();
  return frame_of(tables, only.keyframe).has_right(only.keypoint);
}

}  // namespace hybrid_slam
