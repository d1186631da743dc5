#pragma once

#include <cstdint>

#include "backend/incremental/front.h"

namespace hybrid_slam {

// An edge between two poses, linearised; delta_a and delta_b sum up their increments:
//   r = residual + by_a * delta_a + by_b * delta_b.
struct EdgeTerm {
  std::uint32_t poses[2] = {0, 0};  // those that vary come first
  std::size_t variable = 0;         // how many of them vary
  Matrix6d by_pose[2] = {Matrix6d::Zero(), Matrix6d::Zero()};
  Vector6d residual = Vector6d::Zero();

  void assemble(Front& front) const {
    for (std::size_t i = 0; i < variable; ++i) {
      const std::uint32_t slot = front.slot(poses[i]);
      const Matrix6d own = by_pose[i].transpose() * by_pose[i];
      front.add(slot, slot, own);
      front.add_scale(slot, own.diagonal());
      front.add_gradient(slot, by_pose[i].transpose() * residual);
    }
    if (variable == 2) {
      front.add(front.slot(poses[0]), front.slot(poses[1]), by_pose[0].transpose() * by_pose[1]);
    }
  }
};

}  // namespace hybrid_slam
