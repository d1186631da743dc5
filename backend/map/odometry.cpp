#include "backend/map/odometry.h"

#include <algorithm>
#include <utility>

#include <Eigen/Cholesky>

#include "backend/map/map_tables.h"

namespace hybrid_slam {

namespace {

constexpr double kUnknownTranslation = 30;  // [m]
constexpr double kUnknownRotation = 1;      // [rad]

bool same_camera(const Keyframe& a, const Keyframe& b) {
  return a.observations->camera == b.observations->camera;
}

// The living keyframe of the same camera right after this one; invalid if there is none.
KeyframeId keyframe_after(const MapTables& tables, KeyframeId id) {
  const Keyframe& keyframe = *tables.keyframes.find(id.value);
  for (std::uint32_t after = id.value + 1; after < tables.next_keyframe; ++after) {
    const Keyframe* other = tables.keyframes.find(after);
    if (other != nullptr && same_camera(*other, keyframe)) return other->id;
  }
  return {};
}

}  // namespace

UncertainMotion unknown_motion(const Rigid3d& guess) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(kUnknownTranslation),
      Eigen::Vector3d::Constant(kUnknownRotation);
  return {guess, Matrix6d(sigma.cwiseProduct(sigma).asDiagonal())};
}

// No chain of measured motions that is of use gets that far.
bool is_loose(const Odometry& odometry) {
  const double rotation = kUnknownRotation / 2;
  return odometry.motion.covariance.bottomRightCorner<3, 3>().diagonal().minCoeff() >=
         rotation * rotation;
}

bool is_valid(const Odometry& odometry, std::size_t keypoint_count) {
  const Matrix6d& covariance = odometry.motion.covariance;
  const std::vector<std::uint32_t>& keypoints = odometry.keypoints;
  const auto out_of_order = [](std::uint32_t a, std::uint32_t b) { return a >= b; };
  return odometry.motion.b_from_a.params.allFinite() && covariance.allFinite() &&
         covariance == covariance.transpose() && covariance.llt().info() == Eigen::Success &&
         std::adjacent_find(keypoints.begin(), keypoints.end(), out_of_order) == keypoints.end() &&
         (keypoints.empty() || keypoints.back() < keypoint_count);
}

KeyframeId keyframe_before(const MapTables& tables, KeyframeId id) {
  const Keyframe& keyframe = *tables.keyframes.find(id.value);
  for (std::uint32_t before = id.value; before-- > 0;) {
    const Keyframe* other = tables.keyframes.find(before);
    if (other != nullptr && same_camera(*other, keyframe)) return other->id;
  }
  return {};
}

void attach_odometry(MapTables& tables, KeyframeId id, std::shared_ptr<const Odometry> odometry) {
  if (odometry == nullptr || !odometry->previous.valid()) return;
  if (odometry->previous != keyframe_before(tables, id)) return;
  tables.keyframes.edit(id.value).odometry = std::move(odometry);
}

void detach_odometry(MapTables& tables, KeyframeId id) {
  const KeyframeId after = keyframe_after(tables, id);
  if (!after.valid() || tables.keyframes.find(after.value)->odometry == nullptr) return;
  const auto to = tables.keyframes.find(id.value)->odometry;
  const auto from = tables.keyframes.find(after.value)->odometry;
  std::shared_ptr<const Odometry> both;
  if (to != nullptr) {
    both = std::make_shared<const Odometry>(
        Odometry{to->previous, from->motion * to->motion, from->keypoints, from->dropped});
  }
  tables.keyframes.edit(after.value).odometry = std::move(both);
}

}  // namespace hybrid_slam
