#pragma once

#include <Eigen/Core>

#include "cameras/camera.h"

namespace hybrid_slam {

// Rows of the reprojection error of a measurement (u, v, u_right): 3 of a stereo pair with a right
// match, 2 where u_right is NaN and of all other cameras.
int reprojection_rows(const Camera& camera, const Eigen::Vector3d& measurement);

// reprojection_residual() of a camera whose model is chosen at run time, without any object made:
// of the factor that make_reprojection_factor() makes. d_pose: rows x 7, d_point: rows x 3.
bool camera_reprojection_residual(const Camera& camera, const double* cam_from_world,
                                  const double* point_in_world, const Eigen::Vector3d& measurement,
                                  double sigma, double* residual, double* d_pose, double* d_point);

}  // namespace hybrid_slam
