#include "factors/camera_reprojection.h"

#include <cmath>
#include <type_traits>

#include "factors/reprojection.h"

namespace hybrid_slam {

int reprojection_rows(const Camera& camera, const Eigen::Vector3d& measurement) {
  return std::holds_alternative<Calibrated<RectifiedStereo>>(camera) && !std::isnan(measurement[2])
             ? 3
             : 2;
}

bool camera_reprojection_residual(const Camera& camera, const double* cam_from_world,
                                  const double* point_in_world, const Eigen::Vector3d& measurement,
                                  double sigma, double* residual, double* d_pose, double* d_point) {
  return std::visit(
      [&]<typename M>(const Calibrated<M>& c) {
        const auto of = [&]<typename Model>(Model) {
          return reprojection_residual<Model, 7>(c.params.data(), cam_from_world, point_in_world,
                                                 measurement.data(), 1 / sigma, residual, d_pose,
                                                 d_point, nullptr);
        };
        if constexpr (std::is_same_v<M, RectifiedStereo>) {
          if (std::isnan(measurement[2])) return of(Pinhole());
        }
        return of(M());
      },
      camera);
}

}  // namespace hybrid_slam
