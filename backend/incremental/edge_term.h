#pragma once

#include <cstdint>

#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

class Front;

// An edge between two poses, linearised; delta_a and delta_b sum up their increments:
//   r = residual + by_a * delta_a + by_b * delta_b.
struct EdgeTerm {
  std::uint32_t poses[2] = {0, 0};  // those that vary come first
  std::size_t variable = 0;         // how many of them vary
  Matrix6d by_pose[2] = {Matrix6d::Zero(), Matrix6d::Zero()};
  Vector6d residual = Vector6d::Zero();

  void assemble(Front& front) const;
};

}  // namespace hybrid_slam
