#pragma once

#include <Eigen/Core>

namespace hybrid_slam {

// Both are defined in whitening.cpp, for information of size 3, 6 and 7.

// What is wrong with an information (or any other inverse of a covariance) unless it is finite,
// symmetric and positive semi-definite; null if nothing is. What it does not measure has zeros.
template <int kSize>
const char* information_fault(const Eigen::Matrix<double, kSize, kSize>& information);

// W with |W r|^2 = r^T information r: L^T of L L^T = information, or, where there is none as the
// information is singular, the roots of its eigenvalues times its eigenvectors, transposed. Throws
// std::logic_error where information_fault finds one.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> whitening_of(
    const Eigen::Matrix<double, kSize, kSize>& information);

}  // namespace hybrid_slam
