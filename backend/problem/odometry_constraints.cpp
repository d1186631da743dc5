#include "backend/problem/odometry_constraints.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace hybrid_slam {

double unshared(const MapSnapshot& map, const Keyframe& keyframe) {
  if (keyframe.odometry == nullptr) return 0;
  const Odometry& odometry = *keyframe.odometry;
  if (odometry.keypoints.empty()) return 1;
  const auto is_shared = [&](std::uint32_t keypoint) {
    const LandmarkId id = keyframe.landmarks[keypoint];
    if (!id.valid()) return false;
    const std::vector<Observation>& seen = map.at(id).observations;
    const auto place = std::lower_bound(
        seen.begin(), seen.end(), odometry.previous,
        [](const Observation& o, KeyframeId before) { return o.keyframe < before; });
    return place != seen.end() && place->keyframe == odometry.previous;
  };
  const auto shared =
      std::count_if(odometry.keypoints.begin(), odometry.keypoints.end(), is_shared);
  return 1 - static_cast<double>(shared) / static_cast<double>(odometry.followed());
}

std::optional<PoseConstraint> odometry_constraint(const Keyframe& keyframe, double share) {
  if (keyframe.odometry == nullptr || !(share > 0)) return std::nullopt;
  const UncertainMotion& motion = keyframe.odometry->motion;
  PoseConstraint constraint;
  constraint.a = keyframe.id;
  constraint.b = keyframe.odometry->previous;
  constraint.a_from_b = Sim3d(motion.b_from_a);
  // exp(d) * a_from_b = a_from_b * exp(adjoint(b_from_a) d): what the term compares is in frame b.
  const Matrix6d carry = adjoint(inverse(motion.b_from_a));
  const Matrix6d inverse_of = (carry * motion.covariance * carry.transpose()).inverse();
  const Matrix6d information = 0.5 * share * (inverse_of + inverse_of.transpose());
  // Of a covariance from a file that says next to nothing, rounding can leave anything.
  if (!information.allFinite() || information.llt().info() != Eigen::Success) return std::nullopt;
  constraint.information.topLeftCorner<6, 6>() = information;
  return constraint;
}

std::vector<PoseConstraint> odometry_constraints(const MapSnapshot& map,
                                                 std::span<const KeyframeId> keyframes) {
  std::vector<PoseConstraint> constraints;
  for (const KeyframeId id : keyframes) {
    const Keyframe* keyframe = map.find(id);
    if (keyframe == nullptr) continue;
    const auto constraint = odometry_constraint(*keyframe, unshared(map, *keyframe));
    if (constraint) constraints.push_back(*constraint);
  }
  return constraints;
}

}  // namespace hybrid_slam
