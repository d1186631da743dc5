#include "frontend/pose/bearing_observation.h"

#include <cmath>
#include <limits>

#include "cameras/geometry/se3.h"

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

struct LinearizedBearings {
  PoseNormalEquations equations;
  double cost = 0;
};

LinearizedBearings linearize(std::span<const BearingObservation> observations,
                             const Rigid3d& cam_from_world) {
  LinearizedBearings result;
  const Eigen::Matrix3d rotation = cam_from_world.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = cam_from_world.translation();
  for (const BearingObservation& o : observations) {
    const Eigen::Vector3d point = rotation * o.point_in_world + translation;
    if (!(o.bearing.dot(point) > 0)) {  // its bound has no slope
      result.cost += o.whitening.squaredNorm();
      continue;
    }
    const double inverse_distance = 1 / point.norm();
    const Eigen::Vector3d direction = inverse_distance * point;
    const Eigen::Vector2d residual = o.whitening * direction;
    const Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point =
        inverse_distance * (o.whitening - residual * direction.transpose());
    result.equations.add<2>(pose_jacobian<2>(d_point, point), residual, 1);
    result.cost += residual.squaredNorm();
  }
  return result;
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
  constexpr int kIterations = 30;
  constexpr double kConverged = 1e-7;  // step [m, rad]; the one after it would be far smaller
  constexpr double kFirstDamping = 1e-3;
  constexpr double kMaxDamping = 1e6;
  Rigid3d pose = initial_cam_from_world;
  LinearizedBearings at_pose = linearize(observations, pose);
  double damping = 0;
  for (int i = 0; i < kIterations && damping < kMaxDamping; ++i) {
    const std::optional<Vector6d> step = at_pose.equations.solve(damping);
    if (!step) break;
    const Rigid3d trial = se3_exp(*step) * pose;
    LinearizedBearings at_trial = linearize(observations, trial);
    // The last steps change the cost by rounding alone.
    if (at_trial.cost <= at_pose.cost * (1 + 1e-12)) {
      pose = trial;
      at_pose = at_trial;
      if (damping == 0 && step->norm() < kConverged) break;
      damping = damping > kFirstDamping ? damping / 10 : 0;
    } else {
      damping = damping > 0 ? damping * 10 : kFirstDamping;
    }
  }
  if (!std::isfinite(at_pose.cost) ||
      !is_determined(Matrix6d(at_pose.equations.information.selfadjointView<Eigen::Lower>()))) {
    return std::nullopt;
  }
  return pose;
}

}  // namespace hybrid_slam
