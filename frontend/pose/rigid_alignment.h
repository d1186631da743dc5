#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "cameras/geometry/rigid3d.h"
#include "cameras/geometry/sim3d.h"

namespace hybrid_slam {

// The transform b_from_a that minimises the sum of |b_from_a * points_in_a[i] - points_in_b[i]|^2,
// in closed form (Umeyama, PAMI 1991). None if the rotation is not determined: fewer than three
// points, all points on one line, or values that are not finite. Both spans have the same size.
std::optional<Rigid3d> align_rigid(std::span<const Eigen::Vector3d> points_in_a,
                                   std::span<const Eigen::Vector3d> points_in_b);

// The same with a scale.
std::optional<Sim3d> align_similarity(std::span<const Eigen::Vector3d> points_in_a,
                                      std::span<const Eigen::Vector3d> points_in_b);

}  // namespace hybrid_slam
