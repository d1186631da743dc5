#pragma once

#include <vector>

#include "backend/map/map_tables.h"

namespace hybrid_slam {

// The attributes of a landmark that derive from its observations (backend/map/landmark.h).

// The descriptor with the least median distance to the others. Of more than 8 observations, 8
// spread evenly over them take part: the cost stays bounded, the median hardly changes.
void update_appearance(const MapTables& tables, Landmark& landmark);

// Where the cameras of keyframes are in the world, each found once: for many landmarks in a row,
// while no keyframe moves.
class CameraCenters {
 public:
  explicit CameraCenters(const MapTables& tables);

  const Eigen::Vector3d& of(KeyframeId id);

 private:
  const MapTables& tables_;
  std::vector<Eigen::Vector3d> centers_;  // by keyframe; NaN: not yet found
};

// mean_direction and object_scale, from the poses of the observing keyframes.
void update_geometry(const MapTables& tables, Landmark& landmark);
void update_geometry(const MapTables& tables, CameraCenters& centers, Landmark& landmark);

// What a landmark needs to stay: two observations, or one with depth (a stereo match).
bool is_supported(const MapTables& tables, const Landmark& landmark);

}  // namespace hybrid_slam
