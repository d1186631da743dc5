#include "factors/left_jacobian.h"

#include <algorithm>
#include <utility>

#include "cameras/geometry/rigid3d.h"
#include "cameras/geometry/so3.h"

namespace hybrid_slam {

namespace {

using Lift = Eigen::Matrix<double, 7, 6>;

// d (exp(delta) * pose) / d delta, in the pose's numbers: with q = (v, w),
//   dv = (w turn + turn x v) / 2,  dw = -turn . v / 2,  dt = way + turn x t.
Lift plus_jacobian(const double* pose) {
  const Eigen::Map<const Eigen::Vector3d> v(pose);
  const Eigen::Map<const Eigen::Vector3d> t(pose + 4);
  Lift lift = Lift::Zero();
  lift.block<3, 3>(0, 3) = 0.5 * (pose[3] * Eigen::Matrix3d::Identity() - hat(v));
  lift.block<1, 3>(3, 3) = -0.5 * v.transpose();
  lift.block<3, 3>(4, 0).setIdentity();
  lift.block<3, 3>(4, 3) = -hat(t);
  return lift;
}

class Lifted final : public ceres::CostFunction {
 public:
  Lifted(std::shared_ptr<const ceres::CostFunction> function, std::vector<char> is_pose)
      : function_(std::move(function)), is_pose_(std::move(is_pose)) {
    set_num_residuals(function_->num_residuals());
    *mutable_parameter_block_sizes() = function_->parameter_block_sizes();
  }

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    if (!function_->Evaluate(blocks, residual, jacobians)) return false;
    if (jacobians == nullptr) return true;
    for (std::size_t k = 0; k < is_pose_.size(); ++k) {
      if (is_pose_[k] == 0 || jacobians[k] == nullptr) continue;
      const Lift lift = plus_jacobian(blocks[k]);
      for (int row = 0; row < num_residuals(); ++row) {
        Eigen::Map<Eigen::Matrix<double, 1, 7>> by_pose(jacobians[k] + 7 * row);
        const Eigen::Matrix<double, 1, 6> by_left = by_pose * lift;
        by_pose << by_left, 0;
      }
    }
    return true;
  }

 private:
  std::shared_ptr<const ceres::CostFunction> function_;
  std::vector<char> is_pose_;
};

}  // namespace

std::shared_ptr<const ceres::CostFunction> left_jacobian(
    std::shared_ptr<const ceres::CostFunction> function, const std::vector<char>& is_pose) {
  const bool has_pose =
      std::any_of(is_pose.begin(), is_pose.end(), [](char flag) { return flag != 0; });
  if (!has_pose || dynamic_cast<const LeftJacobian*>(function.get()) != nullptr) return function;
  return std::make_shared<Lifted>(std::move(function), is_pose);
}

}  // namespace hybrid_slam
