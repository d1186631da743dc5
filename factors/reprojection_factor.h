#pragma once

#include <algorithm>
#include <array>
#include <type_traits>

#include <ceres/sized_cost_function.h>

#include "cameras/geometry/rigid3d.h"
#include "factors/left_jacobian.h"
#include "factors/reprojection.h"

namespace hybrid_slam {

enum class Intrinsics { kFixed, kRefined };

// The reprojection error of one observation, for any projection model. Parameter blocks:
//   cam_from_world  7, with a PoseManifold; its Jacobian is [J6 | 0], see manifolds.h
//   point_in_world  3
//   intrinsics      M::kParamCount, only with Intrinsics::kRefined
// Residual: M::kMeasurementDim, in standard deviations.
//
// A point that the model cannot project (behind the camera, beyond the fisheye's range) makes
// Evaluate return false. Ceres then rejects the step that led there and tries a shorter one. Such
// observations are filtered before a problem is built, since Ceres gives up if the first evaluation
// fails.
template <ProjectionModel M, Intrinsics kIntrinsics = Intrinsics::kFixed>
class ReprojectionFactor final
    : public std::conditional_t<kIntrinsics == Intrinsics::kFixed,
                                ceres::SizedCostFunction<M::kMeasurementDim, 7, 3>,
                                ceres::SizedCostFunction<M::kMeasurementDim, 7, 3, M::kParamCount>>,
      public LeftJacobian {
 public:
  using Params = std::array<double, M::kParamCount>;

  // `params` has no effect where the intrinsics are refined. sigma: standard deviation of every
  // coordinate [px], positive.
  ReprojectionFactor(const Params& params, const double* measurement, double sigma)
      : params_(params), inverse_sigma_(1 / sigma) {
    std::copy(measurement, measurement + M::kMeasurementDim, measurement_.begin());
  }

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    constexpr bool kRefined = kIntrinsics == Intrinsics::kRefined;
    const double* params = kRefined ? blocks[2] : params_.data();
    double* d_pose = jacobians == nullptr ? nullptr : jacobians[0];
    double* d_point = jacobians == nullptr ? nullptr : jacobians[1];
    double* d_params = nullptr;
    if constexpr (kRefined) d_params = jacobians == nullptr ? nullptr : jacobians[2];
    return reprojection_residual<M, 7>(params, blocks[0], blocks[1], measurement_.data(),
                                       inverse_sigma_, residual, d_pose, d_point, d_params);
  }

 private:
  Params params_;
  std::array<double, M::kMeasurementDim> measurement_;
  double inverse_sigma_;
};

}  // namespace hybrid_slam
