#include "backend/problem/joint_frame.h"

#include <algorithm>
#include <array>

#include <Eigen/Core>

#include "factors/manifolds.h"

namespace hybrid_slam {

namespace {

constexpr int kMaxParams = 8;
constexpr int kMaxResiduals = 3;

}  // namespace

JointFrameManifold::JointFrameManifold(int params, std::uint32_t refined, bool pose_fixed)
    : params_(params), refined_(refined), pose_fixed_(pose_fixed) {
  for (int k = 0; k < params; ++k) varying_ += varies(k) ? 1 : 0;
}

bool JointFrameManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  std::copy(x, x + AmbientSize(), x_plus_delta);
  if (!pose_fixed_ && !PoseManifold().Plus(x, delta, x_plus_delta)) return false;
  int column = 6;
  for (int k = 0; k < params_; ++k) {
    if (varies(k)) x_plus_delta[7 + k] += delta[column++];
  }
  return true;
}

bool JointFrameManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> lift(
      jacobian, AmbientSize(), TangentSize());
  lift.setZero();
  if (!pose_fixed_) lift.topLeftCorner<6, 6>().setIdentity();
  int column = 6;
  for (int k = 0; k < params_; ++k) {
    if (varies(k)) lift(7 + k, column++) = 1;
  }
  return true;
}

bool JointFrameManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  if (!PoseManifold().Minus(y, x, y_minus_x)) return false;
  int column = 6;
  for (int k = 0; k < params_; ++k) {
    if (varies(k)) y_minus_x[column++] = y[7 + k] - x[7 + k];
  }
  return true;
}

bool JointFrameManifold::MinusJacobian(const double* x, double* jacobian) const {
  Eigen::MatrixXd lift(TangentSize(), AmbientSize());  // column-major: the transpose of row-major
  PlusJacobian(x, lift.data());
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      jacobian, TangentSize(), AmbientSize()) = lift;
  return true;
}

JointFrameFactor::JointFrameFactor(const ceres::CostFunction& separate)
    : separate_(separate), params_(separate.parameter_block_sizes()[2]) {
  set_num_residuals(separate.num_residuals());
  *mutable_parameter_block_sizes() = {7 + params_, 3};
}

bool JointFrameFactor::Evaluate(const double* const* blocks, double* residual,
                                double** jacobians) const {
  const double* separate_blocks[] = {blocks[0], blocks[1], blocks[0] + 7};
  if (jacobians == nullptr || jacobians[0] == nullptr) {
    double* separate_jacobians[] = {nullptr, jacobians == nullptr ? nullptr : jacobians[1],
                                    nullptr};
    return separate_.Evaluate(separate_blocks, residual,
                              jacobians == nullptr ? nullptr : separate_jacobians);
  }
  std::array<double, kMaxResiduals * 7> by_pose;
  std::array<double, kMaxResiduals * kMaxParams> by_params;
  double* separate_jacobians[] = {by_pose.data(), jacobians[1], by_params.data()};
  if (!separate_.Evaluate(separate_blocks, residual, separate_jacobians)) return false;
  for (int row = 0; row < num_residuals(); ++row) {
    double* out = jacobians[0] + row * (7 + params_);
    std::copy_n(by_pose.data() + row * 7, 7, out);
    std::copy_n(by_params.data() + row * params_, params_, out + 7);
  }
  return true;
}

}  // namespace hybrid_slam
