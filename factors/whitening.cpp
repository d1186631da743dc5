#include "factors/whitening.h"

#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "cameras/geometry/sim3d.h"

namespace hybrid_slam {

namespace {

using Eigensystem = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;  // of any size: compiled once

}  // namespace

template <int kSize>
const char* information_fault(const Eigen::Matrix<double, kSize, kSize>& information) {
  using Matrix = Eigen::Matrix<double, kSize, kSize>;
  constexpr double kTolerance = 1e-9;  // relative
  if (!information.allFinite() ||
      (information - information.transpose()).norm() > kTolerance * information.norm()) {
    return "information must be finite and symmetric";
  }
  if (Eigen::LLT<Matrix>(information).info() == Eigen::Success) return nullptr;
  const Eigensystem solver(information, Eigen::EigenvaluesOnly);
  const Eigen::VectorXd& values = solver.eigenvalues();  // ascending
  const bool positive = values[0] >= -kTolerance * values[kSize - 1];
  return positive ? nullptr : "information must be positive semi-definite";
}

template <int kSize>
Eigen::Matrix<double, kSize, kSize> whitening_of(
    const Eigen::Matrix<double, kSize, kSize>& information) {
  using Matrix = Eigen::Matrix<double, kSize, kSize>;
  if (const char* const fault = information_fault<kSize>(information)) {
    throw std::logic_error(fault);
  }
  const Eigen::LLT<Matrix> llt(information);
  if (llt.info() == Eigen::Success) return llt.matrixU();
  const Eigensystem solver(information);
  return solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
         solver.eigenvectors().transpose();
}

template const char* information_fault<3>(const Eigen::Matrix3d&);
template const char* information_fault<6>(const Matrix6d&);
template const char* information_fault<7>(const Matrix7d&);
template Eigen::Matrix3d whitening_of<3>(const Eigen::Matrix3d&);
template Matrix6d whitening_of<6>(const Matrix6d&);
template Matrix7d whitening_of<7>(const Matrix7d&);

}  // namespace hybrid_slam
