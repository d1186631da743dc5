#include "frontend/odometry/stereo_motion_covariance.h"

#include <algorithm>
#include <vector>

#include <Eigen/LU>

#include "frontend/pose/normal_equations.h"
#include "frontend/pose/pose_refinement.h"

namespace hybrid_slam {
namespace {

constexpr double kLeastVariance = 1e-6;   // [px^2]: no measurement is perfect
constexpr double kLeastEfficiency = 0.1;  // where residuals fill the threshold evenly
constexpr int kMaxRounds = 8;             // of variances and efficiencies in turn ...
constexpr double kSettled = 0.01;         // ... until these change by no more

using Params = std::array<double, RectifiedStereo::kParamCount>;

// A point's residual at the motion, in the terms of its noise: along the row, across it, disparity.
struct NoisyResidual {
  Eigen::Matrix<double, 3, 6> by_motion;
  Eigen::Vector3d residual;
  Eigen::Matrix3d weight;                // that it had
  std::array<Eigen::Matrix3d, 3> noise;  // covariance of the residual by each variance
  double own_variance;                   // relative to other points, of both frames
  double efficiency = 1;
};

NoisyResidual noisy_residual(const Params& params, const Rigid3d& motion, const StereoSight& p) {
  // (u_left, v, u_right) -> (their mean, v, disparity).
  const Eigen::Matrix3d terms{{0.5, 0, 0.5}, {0, 1, 0}, {1, 0, -1}};
  const Eigen::Matrix3d measured_from_terms = terms.inverse();
  const Eigen::Vector3d point = motion * p.in_previous;
  Eigen::Vector3d m = Eigen::Vector3d::Zero();  // all inliers project
  Eigen::Vector3d m_previous;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> d_point = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> d_previous = Eigen::Matrix3d::Identity();
  RectifiedStereo::project_with_jacobians(params.data(), point.data(), m.data(), d_point.data(),
                                          nullptr);
  RectifiedStereo::project_with_jacobians(params.data(), p.in_previous.data(), m_previous.data(),
                                          d_previous.data(), nullptr);
  const double v = 0.5 * (p.measured[1] + p.measured[3]);
  const Eigen::Vector3d squared_weight(p.squared_weight, 2 * p.squared_weight, p.squared_weight);
  const Eigen::Matrix3d by_previous =  // by what was measured in the previous frame
      terms * d_point * motion.rotation().toRotationMatrix() * d_previous.inverse() *
      measured_from_terms;
  NoisyResidual result;
  result.by_motion = terms * pose_jacobian<3>(d_point, point);
  result.residual = terms * Eigen::Vector3d(m[0] - p.measured[0], m[1] - v, m[2] - p.measured[2]);
  result.weight =
      measured_from_terms.transpose() * squared_weight.asDiagonal() * measured_from_terms;
  for (int k = 0; k < 3; ++k) {
    Eigen::Matrix3d& noise = result.noise[static_cast<std::size_t>(k)];
    noise = p.previous_variance * by_previous.col(k) * by_previous.col(k).transpose();
    noise(k, k) += p.current_variance;
  }
  result.own_variance = p.previous_variance + p.current_variance;
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

Eigen::Vector3d variances(const std::vector<NoisyResidual>& points, const Explained& explained) {
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
double update_efficiencies(const Eigen::Vector3d& variance, double threshold,
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

std::optional<Matrix6d> stereo_motion_covariance(const Params& params,
                                                 const Rigid3d& current_from_previous,
                                                 std::span<const StereoSight> sights,
                                                 double threshold) {
  std::vector<NoisyResidual> points;
  points.reserve(sights.size());
  for (const StereoSight& sight : sights) {
    points.push_back(noisy_residual(params, current_from_previous, sight));
  }
  Eigen::Vector3d variance;
  std::optional<Explained> explained;
  for (int round = 0; round < kMaxRounds; ++round) {
    explained = explain(points);
    if (!explained) return std::nullopt;
    variance = variances(points, *explained);
    if (update_efficiencies(variance, threshold, points) <= kSettled) break;
  }
  Matrix6d covariance = Matrix6d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    covariance += variance[static_cast<Eigen::Index>(k)] * explained->of_motion[k];
  }
  if (!is_determined(covariance)) return std::nullopt;
  return Matrix6d(0.5 * (covariance + covariance.transpose()));
}

}  // namespace hybrid_slam
