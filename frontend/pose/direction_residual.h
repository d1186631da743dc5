#pragma once

#include <optional>

#include <Eigen/Core>

#include "frontend/pose/bearing_observation.h"

namespace hybrid_slam {

// Squared residual of a point in the camera's frame. In the half space opposite to the bearing,
// where the residual falls again, a bound of it instead.
inline double direction_chi2(const BearingObservation& seen, const Eigen::Vector3d& point_in_cam) {
  if (!(seen.bearing.dot(point_in_cam) > 0)) return seen.whitening.squaredNorm();
  return (seen.whitening * point_in_cam).squaredNorm() / point_in_cam.squaredNorm();
}

// The residual itself, with its derivative by the point.
struct DirectionResidual {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point;
};

// None in the half space opposite to the bearing: the bound has no slope.
inline std::optional<DirectionResidual> direction_residual(const BearingObservation& seen,
                                                           const Eigen::Vector3d& point_in_cam) {
  if (!(seen.bearing.dot(point_in_cam) > 0)) return std::nullopt;
  const double inverse_distance = 1 / point_in_cam.norm();
  const Eigen::Vector3d direction = inverse_distance * point_in_cam;
  const Eigen::Vector2d residual = seen.whitening * direction;
  return DirectionResidual{residual,
                           inverse_distance * (seen.whitening - residual * direction.transpose())};
}

// direction_chi2 of the observation's own point, at a pose.
inline double bearing_chi2(const BearingObservation& observation, const Eigen::Matrix3d& rotation,
                           const Eigen::Vector3d& translation) {
  return direction_chi2(observation, rotation * observation.point_in_world + translation);
}

}  // namespace hybrid_slam
