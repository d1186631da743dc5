#include "frontend/pose/bearing_observation.h"

#include <cmath>
#include <limits>

#include "frontend/pose/damped_gauss_newton.h"
#include "frontend/pose/direction_residual.h"

namespace hybrid_slam {
namespace {

template <ProjectionModel M>
BearingObservation observe(const double* params, const PoseObservation& observation) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  BearingObservation result{observation.point_in_world, Eigen::Vector3d::Constant(kNone),
                            Eigen::Matrix<double, 2, 3, Eigen::RowMajor>::Constant(kNone)};
  Eigen::Vector3d bearing;
  double measurement[M::kMeasurementDim];
  Eigen::Matrix<double, M::kMeasurementDim, 3, Eigen::RowMajor> d_point;
  if (!(observation.sigma > 0) || !observation.measurement.template head<2>().allFinite() ||
      !M::unproject(params, observation.measurement.data(), bearing.data()) ||
      !M::project_with_jacobians(params, bearing.data(), measurement, d_point.data(), nullptr)) {
    return result;
  }
  result.bearing = bearing;
  result.whitening = d_point.template topRows<2>() / observation.sigma;
  return result;
}

NormalEquations<6> linearize(std::span<const BearingObservation> observations,
                             const Rigid3d& cam_from_world) {
  NormalEquations<6> equations;
  const Eigen::Matrix3d rotation = cam_from_world.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = cam_from_world.translation();
  for (const BearingObservation& o : observations) {
    const Eigen::Vector3d point = rotation * o.point_in_world + translation;
    const std::optional<DirectionResidual> seen = direction_residual(o, point);
    if (seen) equations.add<2>(pose_jacobian<2>(seen->d_point, point), seen->residual, 1);
    equations.cost += seen ? seen->residual.squaredNorm() : o.whitening.squaredNorm();
  }
  return equations;
}

}  // namespace

bool BearingObservation::is_usable() const {
  return point_in_world.allFinite() && bearing.allFinite() && whitening.allFinite();
}

std::vector<BearingObservation> bearing_observations(
    const Camera& camera, std::span<const PoseObservation> observations) {
  std::vector<BearingObservation> result;
  result.reserve(observations.size());
  std::visit(
      [&]<typename M>(const Calibrated<M>& calibrated) {
        for (const PoseObservation& observation : observations) {
          result.push_back(observe<M>(calibrated.params.data(), observation));
        }
      },
      camera);
  return result;
}

double bearing_cost(std::span<const BearingObservation> observations,
                    const Rigid3d& cam_from_world) {
  const Eigen::Matrix3d rotation = cam_from_world.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = cam_from_world.translation();
  double cost = 0;
  for (const BearingObservation& o : observations) cost += bearing_chi2(o, rotation, translation);
  return cost;
}

std::optional<Rigid3d> refine_on_bearings(std::span<const BearingObservation> observations,
                                          const Rigid3d& initial_cam_from_world) {
  constexpr GaussNewtonStop kStop{30, 1e-7};  // [m, rad]; the step after it would be far smaller
  const auto minimum = damped_gauss_newton<6>(
      initial_cam_from_world, [&](const Rigid3d& pose) { return linearize(observations, pose); },
      left_perturbed, kStop);
  if (!minimum || !is_determined(minimum->equations.full_information())) return std::nullopt;
  return minimum->state;
}

}  // namespace hybrid_slam
