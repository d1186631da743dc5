#include "backend/incremental/world_tangent.h"

namespace hybrid_slam {

Rigid3d WorldTangent::moved(const Rigid3d& cam_from_world, const Vector6d& increment) const {
  return cam_from_world * se3_exp(at_origin(increment));
}

}  // namespace hybrid_slam
