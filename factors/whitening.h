#pragma once

#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace hybrid_slam {

// L^T with L L^T = information: |L^T r|^2 = r^T information r. Throws std::logic_error unless the
// information is finite, symmetric and positive definite.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> whitening_of(
    const Eigen::Matrix<double, kSize, kSize>& information) {
  constexpr double kTolerance = 1e-9;
  if (!information.allFinite() ||
      (information - information.transpose()).norm() > kTolerance * information.norm()) {
    throw std::logic_error("information must be finite and symmetric");
  }
  const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> llt(information);
  if (llt.info() != Eigen::Success) {
    throw std::logic_error("information must be positive definite");
  }
  return llt.matrixU();
}

}  // namespace hybrid_slam
