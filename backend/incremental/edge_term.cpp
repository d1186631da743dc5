#include "backend/incremental/edge_term.h"

#include "backend/incremental/front.h"

namespace hybrid_slam {

void EdgeTerm::assemble(Front& front) const {
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

}  // namespace hybrid_slam
