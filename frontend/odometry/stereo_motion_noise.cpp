#include "frontend/odometry/stereo_motion_noise.h"

#include <algorithm>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "frontend/pose/damped_gauss_newton.h"
#include "frontend/pose/normal_equations.h"
#include "frontend/pose/pose_refinement.h"

namespace hybrid_slam {
namespace {

constexpr double kLeastVariance = 1e-6;   // [px^2]: no measurement is perfect
constexpr double kLeastEfficiency = 0.1;  // where residuals fill the threshold evenly
constexpr int kMaxRounds = 8;             // of variances and efficiencies in turn ...
constexpr double kSettled = 0.01;         // ... until these change by no more
constexpr int kMaxCorrections = 10;       // of a point, for a motion ...
constexpr double kCorrected = 1e-7;       // ... until it moves by no more [px]
constexpr GaussNewtonStop kStop{100, 1e-6};

using Params = std::array<double, RectifiedStereo::kParamCount>;

// (u_left, v, u_right) -> (their mean, v, disparity).
const Eigen::Matrix3d kTerms{{0.5, 0, 0.5}, {0, 1, 0}, {1, 0, -1}};
const Eigen::Matrix3d kMeasuredFromTerms = kTerms.inverse();

// What the variances are multiplied by in each frame.
struct OwnVariances {
  Eigen::Vector3d previous, current;

  explicit OwnVariances(const StereoSight& sight)
      : previous(sight.previous_variance, sight.previous_variance, sight.current_variance),
        current(Eigen::Vector3d::Constant(sight.current_variance)) {}
};

// A point, linearised where both frames together have it. All in the terms of the noise.
struct CorrectedSight {
  Eigen::Vector3d residual;  // in the current frame, of the point as the previous one measured it
  Eigen::Matrix<double, 3, 6> by_motion;
  Eigen::Matrix3d by_previous;  // by what the previous frame measures
  Eigen::Matrix3d covariance;   // of the residual, by the noise that is assumed
};

// None if there is no such point in front of the camera.
bool linearize_at(const Params& params, const Rigid3d& motion, const Eigen::Vector3d& seen,
                  Eigen::Vector3d& in_current, CorrectedSight& result) {
  const double disparity = seen[2];
  if (!(disparity > 0)) return false;
  const double z = params[0] * params[4] / disparity;
  const Eigen::Vector3d in_previous(z * (seen[0] + 0.5 * disparity - params[2]) / params[0],
                                    z * (seen[1] - params[3]) / params[1], z);
  const Eigen::Vector3d point = motion * in_previous;
  Eigen::Vector3d m, m_previous;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> d_point, d_previous;
  if (!RectifiedStereo::project_with_jacobians(params.data(), point.data(), m.data(),
                                               d_point.data(), nullptr) ||
      !RectifiedStereo::project_with_jacobians(params.data(), in_previous.data(), m_previous.data(),
                                               d_previous.data(), nullptr)) {
    return false;
  }
  in_current = kTerms * m;
  result.by_motion = kTerms * pose_jacobian<3>(d_point, point);
  result.by_previous = kTerms * d_point * motion.rotation().toRotationMatrix() *
                       d_previous.inverse() * kMeasuredFromTerms;
  return true;
}

std::optional<CorrectedSight> corrected(const Params& params, const Rigid3d& motion,
                                        const StereoSight& sight, const StereoNoise& noise) {
  const OwnVariances own(sight);
  const Eigen::Matrix3d of_previous = noise.cwiseProduct(own.previous).asDiagonal();
  const Eigen::Matrix3d of_current = noise.cwiseProduct(own.current).asDiagonal();
  const Eigen::Vector3d measured = kTerms * sight.previous;
  Eigen::Vector3d seen = measured;
  CorrectedSight result;
  for (int i = 0; i < kMaxCorrections; ++i) {
    Eigen::Vector3d in_current;
    if (!linearize_at(params, motion, seen, in_current, result)) return std::nullopt;
    result.residual = in_current - kTerms * sight.current + result.by_previous * (measured - seen);
    const Eigen::Matrix3d back = of_previous * result.by_previous.transpose();
    result.covariance = of_current + result.by_previous * back;
    const Eigen::Vector3d before = seen;
    seen = measured - back * result.covariance.llt().solve(result.residual);
    if ((seen - before).cwiseAbs().maxCoeff() < kCorrected) break;
  }
  return result;
}

// A point's residual at the motion.
struct NoisyResidual {
  Eigen::Matrix<double, 3, 6> by_motion;
  Eigen::Vector3d residual;
  Eigen::Matrix3d weight;                // that it had
  std::array<Eigen::Matrix3d, 3> noise;  // covariance of the residual by each variance
  double own_variance;                   // relative to other points, of both frames
  double efficiency = 1;
};

NoisyResidual noisy_residual(const StereoSight& sight, const CorrectedSight& at) {
  const OwnVariances own(sight);
  NoisyResidual result;
  result.by_motion = at.by_motion;
  result.residual = at.residual;
  result.weight = sight.squared_weight * at.covariance.inverse();
  for (int k = 0; k < 3; ++k) {
    Eigen::Matrix3d& noise = result.noise[static_cast<std::size_t>(k)];
    noise = own.previous[k] * at.by_previous.col(k) * at.by_previous.col(k).transpose();
    noise(k, k) += own.current[k];
  }
  result.own_variance = sight.previous_variance + sight.current_variance;
  return result;
}

// What the variances explain of the motion and of the residuals.
struct Explained {
  std::array<Matrix6d, 3> of_motion;  // covariance, by variance
  Eigen::Matrix3d of_squares;         // summed, each over its point's own variance; by variance
};

// None if the points leave the motion open.
std::optional<Explained> explain(const std::vector<NoisyResidual>& points) {
  Matrix6d information = Matrix6d::Zero();
  for (const NoisyResidual& point : points) {
    information += point.efficiency * point.by_motion.transpose() * point.weight * point.by_motion;
  }
  if (!is_determined(information)) return std::nullopt;
  const Matrix6d inverse = information.inverse();
  Explained result;
  for (std::size_t k = 0; k < 3; ++k) {
    Matrix6d spread = Matrix6d::Zero();
    for (const NoisyResidual& point : points) {
      const Eigen::Matrix<double, 3, 6> weighted = point.weight * point.by_motion;
      spread += point.efficiency * weighted.transpose() * point.noise[k] * weighted;
    }
    result.of_motion[k] = inverse * spread * inverse;
    Eigen::Vector3d squares = Eigen::Vector3d::Zero();
    for (const NoisyResidual& point : points) {
      const Eigen::Matrix3d noise = point.efficiency * point.noise[k];
      const Eigen::Matrix3d fitted =
          point.by_motion * inverse * (point.weight * point.by_motion).transpose() * noise;
      squares +=
          (noise - 2 * fitted + point.by_motion * result.of_motion[k] * point.by_motion.transpose())
              .diagonal() /
          point.own_variance;
    }
    result.of_squares.col(static_cast<Eigen::Index>(k)) = squares;
  }
  return result;
}

StereoNoise variances(const std::vector<NoisyResidual>& points, const Explained& explained) {
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (const NoisyResidual& point : points) {
    squares += point.residual.cwiseAbs2() / point.own_variance;
  }
  Eigen::Vector3d variance = explained.of_squares.partialPivLu().solve(squares);
  if (!(variance.minCoeff() > 0)) {
    variance = squares.cwiseQuotient(explained.of_squares.rowwise().sum());
  }
  // 1 / variance, by which errors are normalised, is too large on average.
  const double freedom = 3.0 * static_cast<double>(points.size()) - 6;
  return (variance * freedom / std::max(freedom - 2, 1.0)).cwiseMax(kLeastVariance);
}

// By the mean variance of a point's residuals. Returns the largest change.
double update_efficiencies(const StereoNoise& variance, double threshold,
                           std::vector<NoisyResidual>& points) {
  double change = 0;
  for (NoisyResidual& point : points) {
    Eigen::Vector3d terms = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      terms += variance[static_cast<Eigen::Index>(k)] * point.noise[k].diagonal();
    }
    // u_left^2 + u_right^2 = 2 mean^2 + disparity^2 / 2.
    const double mean = (2 * terms[0] + 2 * terms[1] + 0.5 * terms[2]) / 3;
    const double efficiency =
        std::max(kLeastEfficiency, inlier_efficiency(3, threshold * threshold / mean));
    change = std::max(change, std::abs(efficiency - point.efficiency));
    point.efficiency = efficiency;
  }
  return change;
}

}  // namespace

std::optional<Rigid3d> fit_stereo_motion(const Params& params, const Rigid3d& start,
                                         std::span<const StereoSight> sights,
                                         const StereoNoise& noise) {
  const auto linearize = [&](const Rigid3d& motion) -> std::optional<NormalEquations<6>> {
    NormalEquations<6> equations;
    for (const StereoSight& sight : sights) {
      const auto at = corrected(params, motion, sight, noise);
      if (!at) return std::nullopt;
      const auto root = at->covariance.llt();
      const Eigen::Vector3d residual = root.matrixL().solve(at->residual);
      const Eigen::Matrix<double, 3, 6, Eigen::RowMajor> jacobian =
          root.matrixL().solve(at->by_motion);
      equations.add<3>(jacobian, residual, sight.squared_weight);
      equations.cost += sight.squared_weight * residual.squaredNorm();
    }
    return equations;
  };
  const auto minimum = damped_gauss_newton<6>(start, linearize, left_perturbed, kStop);
  if (!minimum || !minimum->converged) return std::nullopt;
  return minimum->state;
}

std::optional<StereoMotionUncertainty> stereo_motion_uncertainty(
    const Params& params, const Rigid3d& current_from_previous, std::span<const StereoSight> sights,
    const StereoNoise& assumed, double threshold) {
  std::vector<NoisyResidual> points;
  points.reserve(sights.size());
  for (const StereoSight& sight : sights) {
    const auto at = corrected(params, current_from_previous, sight, assumed);
    if (at) points.push_back(noisy_residual(sight, *at));
  }
  StereoNoise noise;
  std::optional<Explained> explained;
  for (int round = 0; round < kMaxRounds; ++round) {
    explained = explain(points);
    if (!explained) return std::nullopt;
    noise = variances(points, *explained);
    if (update_efficiencies(noise, threshold, points) <= kSettled) break;
  }
  Matrix6d covariance = Matrix6d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    covariance += noise[static_cast<Eigen::Index>(k)] * explained->of_motion[k];
  }
  if (!is_determined(covariance)) return std::nullopt;
  return StereoMotionUncertainty{0.5 * (covariance + covariance.transpose()), noise};
}

}  // namespace hybrid_slam
