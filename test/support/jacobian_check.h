#pragma once

#include <algorithm>
#include <limits>

#include <Eigen/Core>

namespace hybrid_slam {

using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// d f / d x at x by central differences of fourth order; error about 1e-10 of f's size for
// functions that vary over a length of 1. f takes and returns vectors.
template <typename F>
RowMajorMatrix numeric_jacobian(const F& f, const Eigen::VectorXd& x, double step = 1e-3) {
  RowMajorMatrix jacobian;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const auto at = [&](double steps) -> Eigen::VectorXd {
      Eigen::VectorXd moved = x;
      moved[i] += steps * step;
      return f(moved);
    };
    const Eigen::VectorXd column = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step);
    if (i == 0) jacobian.resize(column.size(), x.size());
    jacobian.col(i) = column;
  }
  return jacobian;
}

// The largest difference between two Jacobians, relative to their largest entry; infinite if the
// shapes differ or an entry is not finite. What every Jacobian test asserts on.
inline double jacobian_mismatch(const RowMajorMatrix& a, const RowMajorMatrix& b) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (a.rows() != b.rows() || a.cols() != b.cols()) return kInfinity;
  if (a.size() == 0) return 0;
  if (!a.allFinite() || !b.allFinite()) return kInfinity;
  const double size = std::max(a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff());
  return size == 0 ? 0 : (a - b).cwiseAbs().maxCoeff() / size;
}

}  // namespace hybrid_slam
