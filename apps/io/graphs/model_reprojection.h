#pragma once

#include <string_view>

#include <ceres/sized_cost_function.h>

#include "cameras/geometry/so3.h"
#include "cameras/projection.h"
#include "factors/left_jacobian.h"
#include "factors/transform_error.h"

namespace hybrid_slam {

// A reprojection whose camera is of a model that the variant Camera does not have.
class NamedReprojection {
 public:
  virtual ~NamedReprojection() = default;
  virtual std::string_view model_name() const = 0;
};

// A point seen by a camera of any model. Blocks: cam_from_world (7, PoseManifold), point in the
// world (3), the model's parameters.
//   residual = project(params, cam_from_world * point) - measured [px]
// Has no value where the point does not project.
template <ProjectionModel M>
class ModelReprojection final : public ceres::SizedCostFunction<2, 7, 3, M::kParamCount>,
                                public LeftJacobian,
                                public NamedReprojection {
 public:
  explicit ModelReprojection(const Eigen::Vector2d& measured) : measured_(measured) {}

  std::string_view model_name() const override { return M::kName; }

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    const Rigid3d cam_from_world = from_block<Rigid3d>(blocks[0]);
    const Eigen::Map<const Eigen::Vector3d> point(blocks[1]);
    const Eigen::Vector3d in_cam = cam_from_world * Eigen::Vector3d(point);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_cam;
    double* const by_params = jacobians == nullptr ? nullptr : jacobians[2];
    if (!M::project_with_jacobians(blocks[2], in_cam.data(), pixel.data(), by_cam.data(),
                                   by_params)) {
      return false;
    }
    Eigen::Map<Eigen::Vector2d>{residual} = pixel - measured_;
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> by_pose(jacobians[0]);
      by_pose << by_cam, -by_cam * hat(in_cam), Eigen::Vector2d::Zero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> by_point(jacobians[1]);
      by_point = by_cam * cam_from_world.rotation().toRotationMatrix();
    }
    return true;
  }

 private:
  Eigen::Vector2d measured_;
};

}  // namespace hybrid_slam
