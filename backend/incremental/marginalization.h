#pragma once

#include <Eigen/Core>

namespace hybrid_slam {

// A linear least-squares problem |jacobian x + residual|^2.
struct LinearSystem {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residual;
};

// What a problem says about the last columns once its first `count` unknowns are minimised out: the
// Schur complement, in square-root form, found by Householder reflections on the rows themselves.
// No normal equations are formed, so that it cannot become indefinite; unknowns that the rows do
// not determine are skipped (rank-revealing, as in Demmel et al., Square Root Marginalization for
// Sliding-Window Bundle Adjustment, ICCV 2021). At most as many rows as columns, without rows of
// zeros; up to a constant the same cost.
LinearSystem marginalize(const LinearSystem& system, Eigen::Index count);

}  // namespace hybrid_slam
