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

// Sum of bearing_chi2 (direction_residual.h).
double bearing_cost(std::span<const BearingObservation> observations,
                    const Rigid3d& cam_from_world);

// The pose nearby that minimises the sum of squared residuals, by damped_gauss_newton. None if the
// observations leave the pose open or are not finite.
std::optional<Rigid3d> refine_on_bearings(std::span<const BearingObservation> observations,
                                          const Rigid3d& initial_cam_from_world);

}  // namespace hybrid_slam
