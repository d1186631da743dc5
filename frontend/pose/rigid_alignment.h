#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "cameras/geometry/rigid3d.h"
#include "cameras/geometry/sim3d.h"

namespace hybrid_slam {

// Points on one line leave the rotation about it open. A pose needs it; the error of a straight
// path does not.
enum class CollinearPoints { kRefuse, kAlign };

// The transform b_from_a that minimises the sum of |b_from_a * points_in_a[i] - points_in_b[i]|^2,
// in closed form (Umeyama, PAMI 1991). None for fewer than three points, values that are not finite
// and, if refused, points on one line. Both spans have the same size.
std::optional<Rigid3d> align_rigid(std::span<const Eigen::Vector3d> points_in_a,
                                   std::span<const Eigen::Vector3d> points_in_b,
                                   CollinearPoints collinear = CollinearPoints::kRefuse);

// The same with a scale, which must come out positive.
std::optional<Sim3d> align_similarity(std::span<const Eigen::Vector3d> points_in_a,
                                      std::span<const Eigen::Vector3d> points_in_b,
                                      CollinearPoints collinear = CollinearPoints::kRefuse);

}  // namespace hybrid_slam
