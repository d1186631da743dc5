#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cameras/camera.h"
#include "frontend/pose/pose_refinement.h"

namespace hybrid_slam {

// A known point and the direction in which a camera of any model saw it. The rows of `whitening`
// are tangent to the sphere of directions at the bearing, and so scaled that the residual
//   whitening * point_in_cam / |point_in_cam|
// of a true pose is 0 on average and has unit covariance. It is in pixels over their standard
// deviation, to first order: the reduced residual of Urban, Leitloff and Hinz (2016, eq. 9), whose
// basis of the null space and covariance both come out of the projection's Jacobian.
struct BearingObservation {
  Eigen::Vector3d point_in_world;
  Eigen::Vector3d bearing;  // unit
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> whitening;

  // False for what no pose can explain: bearing_observations found no ray, or numbers that are not
  // finite.
  bool is_usable() const;
};

// One per observation (of which u_right is not used): the pixel's ray, and the Jacobian of the
// projection over the pixel's standard deviation. Rays beyond 90 degrees are nothing special. Where
// the pixel has no ray, or a sigma that is not positive, the bearing is NaN.
std::vector<BearingObservation> bearing_observations(const Camera& camera,
                                                     std::span<const PoseObservation> observations);

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

// Sum of bearing_chi2.
double bearing_cost(std::span<const BearingObservation> observations,
                    const Rigid3d& cam_from_world);

// The pose nearby that minimises the sum of squared residuals, by damped_gauss_newton. None if the
// observations leave the pose open or are not finite.
std::optional<Rigid3d> refine_on_bearings(std::span<const BearingObservation> observations,
                                          const Rigid3d& initial_cam_from_world);

}  // namespace hybrid_slam
