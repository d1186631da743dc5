#pragma once

#include <ceres/sized_cost_function.h>

#include "cameras/geometry/rigid3d.h"
#include "cameras/geometry/so3.h"
#include "factors/left_jacobian.h"
#include "factors/transform_error.h"
#include "factors/whitening.h"

namespace hybrid_slam {

// The measured position of a point in a sensor that a frame carries (g2o's EDGE_SE3_TRACKXYZ).
// Blocks: cam_from_world (7, PoseManifold), point in the world (3).
//   residual = W (sensor_from_cam * cam_from_world * point - measured) [m],  W^T W = information
class PointInFrame final : public ceres::SizedCostFunction<3, 7, 3>, public LeftJacobian {
 public:
  // Throws std::logic_error unless the information is symmetric and positive semi-definite.
  PointInFrame(const Eigen::Vector3d& measured, const Eigen::Matrix3d& information,
               const Rigid3d& sensor_from_cam)
      : measured_(measured),
        whitening_(whitening_of(information)),
        sensor_from_cam_(sensor_from_cam) {}

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    const Rigid3d cam_from_world = from_block<Rigid3d>(blocks[0]);
    const Eigen::Map<const Eigen::Vector3d> point(blocks[1]);
    const Eigen::Vector3d in_cam = cam_from_world * Eigen::Vector3d(point);
    Eigen::Map<Eigen::Vector3d>{residual} = whitening_ * (sensor_from_cam_ * in_cam - measured_);
    if (jacobians == nullptr) return true;
    const Eigen::Matrix3d by_cam = whitening_ * sensor_from_cam_.rotation().toRotationMatrix();
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 3, 7, Eigen::RowMajor>> by_pose(jacobians[0]);
      by_pose << by_cam, -by_cam * hat(in_cam), Eigen::Vector3d::Zero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> by_point(jacobians[1]);
      by_point = by_cam * cam_from_world.rotation().toRotationMatrix();
    }
    return true;
  }

 private:
  Eigen::Vector3d measured_;
  Eigen::Matrix3d whitening_;
  Rigid3d sensor_from_cam_;
};

}  // namespace hybrid_slam
