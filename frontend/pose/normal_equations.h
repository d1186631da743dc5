#pragma once

#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// Least squares in the six unknowns of one pose, perturbed on the left: (translation, rotation).
struct PoseNormalEquations {
  Matrix6d information = Matrix6d::Zero();  // sum of w J^T J; the lower triangle while summing
  Vector6d gradient = Vector6d::Zero();     // sum of w J^T r

  // Adds N residuals r with their Jacobian (row-major N x 6) and a common weight.
  template <int N>
  void add(const Eigen::Matrix<double, N, 6, Eigen::RowMajor>& jacobian,
           const Eigen::Matrix<double, N, 1>& residual, double weight) {
    for (int row = 0; row < N; ++row) {
      for (int i = 0; i < 6; ++i) {
        const double weighted = weight * jacobian(row, i);
        gradient[i] += weighted * residual[row];
        for (int j = 0; j <= i; ++j) information(i, j) += weighted * jacobian(row, j);
      }
    }
  }

  // The step that minimises the linearised cost, each diagonal entry enlarged by the factor
  // 1 + damping. None if it is not finite.
  std::optional<Vector6d> solve(double damping) const {
    Matrix6d damped = information.selfadjointView<Eigen::Lower>();
    damped.diagonal() *= 1 + damping;
    const Vector6d step = -damped.ldlt().solve(gradient);
    if (!step.allFinite()) return std::nullopt;
    return step;
  }
};

// Whether a system (symmetric) determines all its unknowns, whatever the units of each.
template <int N>
bool is_determined(Eigen::Matrix<double, N, N> information) {
  constexpr double kMinConditioning = 1e-12;  // smallest / largest eigenvalue of the scaled system
  if (!(information.diagonal().minCoeff() > 0) || !information.allFinite()) return false;
  const Eigen::Matrix<double, N, 1> scale = information.diagonal().cwiseSqrt().cwiseInverse();
  information = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> eigen(information,
                                                                         Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()[0] > kMinConditioning * eigen.eigenvalues()[N - 1];
}

// d residual / d pose (N x 6, left perturbation) from d residual / d point_in_cam (N x 3): a
// perturbed pose moves the point by translation + rotation x point.
template <int N>
Eigen::Matrix<double, N, 6, Eigen::RowMajor> pose_jacobian(
    const Eigen::Matrix<double, N, 3, Eigen::RowMajor>& d_point,
    const Eigen::Vector3d& point_in_cam) {
  Eigen::Matrix<double, N, 6, Eigen::RowMajor> jacobian;
  for (int row = 0; row < N; ++row) {
    const Eigen::Vector3d d = d_point.row(row);
    jacobian.row(row) << d.transpose(), point_in_cam.cross(d).transpose();
  }
  return jacobian;
}

}  // namespace hybrid_slam
