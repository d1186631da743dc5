#pragma once

#include <cstdint>

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

namespace hybrid_slam {

// Pose and intrinsics of a frame that has its camera for itself, as one block: (pose 7, params).
// Ceres' Schur code is compiled for one block size per frame, such as the 9 of a BAL camera; with
// poses and intrinsics as blocks of their own it falls back to code for any size
// (docs/benchmarks.md).
class JointFrameManifold final : public ceres::Manifold {
 public:
  // Bit k of `refined`: params[k] varies. A fixed pose keeps its place in the tangent, where
  // nothing depends on it, so that all frames are alike.
  JointFrameManifold(int params, std::uint32_t refined, bool pose_fixed);

  int AmbientSize() const override { return 7 + params_; }
  int TangentSize() const override { return 6 + varying_; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

 private:
  bool varies(int param) const { return (refined_ >> param & 1U) != 0; }

  int params_;
  std::uint32_t refined_;
  bool pose_fixed_;
  int varying_ = 0;
};

// A refining reprojection factor (blocks: pose, point, intrinsics) on a joint frame and a point.
// Does not own the factor.
class JointFrameFactor final : public ceres::CostFunction {
 public:
  explicit JointFrameFactor(const ceres::CostFunction& separate);

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  const ceres::CostFunction& separate_;
  int params_;
};

}  // namespace hybrid_slam
