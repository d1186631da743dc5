#include "factors/make_reprojection_factor.h"

#include <cmath>
#include <stdexcept>
#include <type_traits>

#include "factors/reprojection_factor.h"

namespace hybrid_slam {

template class ReprojectionFactor<Pinhole, Intrinsics::kFixed>;
template class ReprojectionFactor<Pinhole, Intrinsics::kRefined>;
template class ReprojectionFactor<RectifiedStereo, Intrinsics::kFixed>;
template class ReprojectionFactor<RectifiedStereo, Intrinsics::kRefined>;
template class ReprojectionFactor<LeftOfStereo, Intrinsics::kRefined>;
template class ReprojectionFactor<KannalaBrandt, Intrinsics::kFixed>;
template class ReprojectionFactor<KannalaBrandt, Intrinsics::kRefined>;
template class ReprojectionFactor<Radial, Intrinsics::kFixed>;
template class ReprojectionFactor<Radial, Intrinsics::kRefined>;
template class ReprojectionFactor<Bal, Intrinsics::kFixed>;
template class ReprojectionFactor<Bal, Intrinsics::kRefined>;

namespace {

template <typename M, Intrinsics kIntrinsics, std::size_t kCount>
std::unique_ptr<ceres::CostFunction> make(const std::array<double, kCount>& camera_params,
                                          const Eigen::Vector3d& measurement, double sigma) {
  std::array<double, M::kParamCount> params;
  static_assert(kCount >= M::kParamCount);
  std::copy(camera_params.begin(), camera_params.begin() + M::kParamCount, params.begin());
  return std::make_unique<ReprojectionFactor<M, kIntrinsics>>(params, measurement.data(), sigma);
}

template <Intrinsics kIntrinsics>
std::unique_ptr<ceres::CostFunction> visit_camera(const Camera& camera,
                                                  const Eigen::Vector3d& measurement,
                                                  double sigma) {
  if (!measurement.head<2>().allFinite() || !(sigma > 0) || !std::isfinite(sigma)) {
    throw std::logic_error("make_reprojection_factor: measurement and sigma must be finite");
  }
  return std::visit(
      [&]<typename M>(const Calibrated<M>& c) {
        if constexpr (std::is_same_v<M, RectifiedStereo>) {
          using Left = std::conditional_t<kIntrinsics == Intrinsics::kFixed, Pinhole, LeftOfStereo>;
          if (std::isnan(measurement[2])) {
            return make<Left, kIntrinsics>(c.params, measurement, sigma);
          }
        }
        return make<M, kIntrinsics>(c.params, measurement, sigma);
      },
      camera);
}

}  // namespace

std::unique_ptr<ceres::CostFunction> make_reprojection_factor(const Camera& camera,
                                                              const Eigen::Vector3d& measurement,
                                                              double sigma) {
  return visit_camera<Intrinsics::kFixed>(camera, measurement, sigma);
}

std::unique_ptr<ceres::CostFunction> make_refining_reprojection_factor(
    const Camera& camera, const Eigen::Vector3d& measurement, double sigma) {
  return visit_camera<Intrinsics::kRefined>(camera, measurement, sigma);
}

}  // namespace hybrid_slam
