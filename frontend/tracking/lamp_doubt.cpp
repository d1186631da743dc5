#include "frontend/tracking/lamp_doubt.h"

namespace hybrid_slam {

void LampDoubt::widen(const MapSnapshot& map, const ShadingDoubt& doubt, TrackedFrame& frame) {
  const Keyframe* const base = map.find(frame.covariance_base);
  if (base == nullptr) return;
  if (base->id != base_) arm_at_base_.reset();
  base_ = base->id;
  if (!arm_at_base_) arm_at_base_ = arm_;
  const auto add = [&](const Eigen::Vector3d& way, double share) {
    const Eigen::Vector3d off = share * (frame.cam_from_world.rotation() * way);
    frame.covariance.topLeftCorner<3, 3>() += mean_square_share_ * off * off.transpose();
  };
  if (vehicle_) add(*vehicle_ - inverse(base->cam_from_world).translation(), doubt.of_vehicle);
  if (arm_) add(*arm_ - *arm_at_base_, doubt.of_arm);
}

}  // namespace hybrid_slam
