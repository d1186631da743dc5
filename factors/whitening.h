#pragma once

#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace hybrid_slam {

// What is wrong with an information (or any other inverse of a covariance) unless it is finite,
// symmetric and positive semi-definite; null if nothing is. What it does not measure has zeros.
template <int kSize>
const char* information_fault(const Eigen::Matrix<double, kSize, kSize>& information) {
  using Matrix = Eigen::Matrix<double, kSize, kSize>;
  constexpr double kTolerance = 1e-9;  // relative
  if (!information.allFinite() ||
      (information - information.transpose()).norm() > kTolerance * information.norm()) {
    return "information must be finite and symmetric";
  }
  if (Eigen::LLT<Matrix>(information).info() == Eigen::Success) return nullptr;
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(information, Eigen::EigenvaluesOnly);
  const auto& values = solver.eigenvalues();  // ascending
  const bool positive = values[0] >= -kTolerance * values[kSize - 1];
  return positive ? nullptr : "information must be positive semi-definite";
}

// W with |W r|^2 = r^T information r: L^T of L L^T = information, or, where there is none as the
// information is singular, the roots of its eigenvalues times its eigenvectors, transposed. Throws
// std::logic_error where information_fault finds one.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> whitening_of(
    const Eigen::Matrix<double, kSize, kSize>& information) {
  using Matrix = Eigen::Matrix<double, kSize, kSize>;
  if (const char* const fault = information_fault<kSize>(information)) {
    throw std::logic_error(fault);
  }
  const Eigen::LLT<Matrix> llt(information);
  if (llt.info() == Eigen::Success) return llt.matrixU();
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(information);
  return solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
         solver.eigenvectors().transpose();
}

}  // namespace hybrid_slam
