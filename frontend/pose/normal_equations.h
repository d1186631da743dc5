#pragma once

#include <optional>

#include <Eigen/Core>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// Least squares in N unknowns, linearised: cost + 2 gradient . step + step . information step.
// `solve` is defined in normal_equations.cpp, for N of 1, 2, 3, 6 and 7.
template <int N>
struct NormalEquations {
  using Step = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;

  Matrix information = Matrix::Zero();  // sum of w J^T J; the lower triangle alone
  Step gradient = Step::Zero();         // sum of w J^T r
  double cost = 0;                      // what is minimised: the sum of the losses, by the caller

  // Adds residuals r with their Jacobian (row-major) and a common weight.
  template <int Rows>
  void add(const Eigen::Matrix<double, Rows, N, Eigen::RowMajor>& jacobian,
           const Eigen::Matrix<double, Rows, 1>& residual, double weight) {
    for (int row = 0; row < Rows; ++row) {
      for (int i = 0; i < N; ++i) {
        const double weighted = weight * jacobian(row, i);
        gradient[i] += weighted * residual[row];
        for (int j = 0; j <= i; ++j) information(i, j) += weighted * jacobian(row, j);
      }
    }
  }

  Matrix full_information() const { return information.template selfadjointView<Eigen::Lower>(); }

  // The step that minimises the linearised cost, each diagonal entry enlarged by the factor
  // 1 + damping. None if it is not finite.
  std::optional<Step> solve(double damping) const;
};

// Whether a system (symmetric) determines all its unknowns, whatever the units of each.
bool is_determined(const Eigen::Ref<const Eigen::MatrixXd>& information);

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

// The pose after a step of the unknowns.
inline Rigid3d left_perturbed(const Vector6d& step, const Rigid3d& pose) {
  return se3_exp(step) * pose;
}

}  // namespace hybrid_slam
