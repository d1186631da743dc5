#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "backend/map/map.h"

namespace hybrid_slam {

// What of a map shall stay: what fits all that is given.
struct CropOptions {
  std::optional<Eigen::AlignedBox3d> box;  // in the world [m]
  std::optional<double> from, to;          // times of keyframes [s], both included
  std::optional<KeyframeId> component;     // by its name
};

// The part of a map. Of a box: the landmarks in it, and the keyframes that see at least 15 of them,
// as many as make two keyframes neighbours; they keep what else they measured, without its
// landmarks. Of times and components: these keyframes and the landmarks that they see enough of
// (assemble_map). The world stays, so that the first keyframe need not be its origin any more; ids
// are new. Throws InputError, without a file's name, if nothing would be left or there is no such
// component.
Map crop_map(const MapSnapshot& map, const CropOptions& options);

}  // namespace hybrid_slam
