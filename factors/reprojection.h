#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cameras/projection.h"

namespace hybrid_slam {

// The whitened reprojection error of a point and its derivatives, without any solver's types:
//   residual = (project(cam_from_world * point_in_world) - measurement) / sigma
// cam_from_world: 7 doubles as in Rigid3d (unit quaternion), point_in_world: 3, measurement and
// residual: M::kMeasurementDim. Row-major Jacobians, each may be null:
//   d_pose    kMeasurementDim x kPoseStride; columns 0..5 are the derivative by delta in
//             exp(delta) * cam_from_world, delta = (translation, rotation); others are set to 0
//   d_point   kMeasurementDim x 3
//   d_params  kMeasurementDim x M::kParamCount
// False, and every output untouched, if the model cannot project the point.
template <ProjectionModel M, int kPoseStride = 6>
bool reprojection_residual(const double* params, const double* cam_from_world,
                           const double* point_in_world, const double* measurement,
                           double inverse_sigma, double* residual, double* d_pose, double* d_point,
                           double* d_params) {
  constexpr int kDim = M::kMeasurementDim;
  const Eigen::Matrix3d rotation =
      Eigen::Map<const Eigen::Quaterniond>(cam_from_world).toRotationMatrix();
  const Eigen::Vector3d p = rotation * Eigen::Map<const Eigen::Vector3d>(point_in_world) +
                            Eigen::Map<const Eigen::Vector3d>(cam_from_world + 4);

  double projected[kDim];
  if (d_pose == nullptr && d_point == nullptr && d_params == nullptr) {
    if (!M::template project<double>(params, p.data(), projected)) return false;
    for (int i = 0; i < kDim; ++i) residual[i] = inverse_sigma * (projected[i] - measurement[i]);
    return true;
  }

  double d_projection[kDim * 3];
  if (!M::project_with_jacobians(params, p.data(), projected, d_projection, d_params)) return false;
  for (int i = 0; i < kDim; ++i) {
    residual[i] = inverse_sigma * (projected[i] - measurement[i]);
    const double a = inverse_sigma * d_projection[3 * i];
    const double b = inverse_sigma * d_projection[3 * i + 1];
    const double c = inverse_sigma * d_projection[3 * i + 2];
    if (d_pose != nullptr) {  // (a, b, c) * [I | -hat(p)]
      double* row = d_pose + kPoseStride * i;
      row[0] = a;
      row[1] = b;
      row[2] = c;
      row[3] = c * p[1] - b * p[2];
      row[4] = a * p[2] - c * p[0];
      row[5] = b * p[0] - a * p[1];
      for (int j = 6; j < kPoseStride; ++j) row[j] = 0;
    }
    if (d_point != nullptr) {
      for (int j = 0; j < 3; ++j) {
        d_point[3 * i + j] = a * rotation(0, j) + b * rotation(1, j) + c * rotation(2, j);
      }
    }
  }
  if (d_params != nullptr) {
    for (int i = 0; i < kDim * M::kParamCount; ++i) d_params[i] *= inverse_sigma;
  }
  return true;
}

}  // namespace hybrid_slam
