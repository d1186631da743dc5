#include <algorithm>
#include <cmath>

#include "backend/problem/bundle_equations.h"

namespace hybrid_slam {

namespace {

// So many points of a group go into one product: their panels stay in the fastest cache.
constexpr std::uint32_t kPointsAtOnce = 8;

// What Ceres limits the damped diagonal to, in scaled units.
constexpr double kLeastDiagonal = 1e-6;
constexpr double kMostDiagonal = 1e32;

// In scaled units the damping is the diagonal of the information over the radius.
double damping(double diagonal, double unit, double radius) {
  return std::clamp(diagonal / unit, kLeastDiagonal, kMostDiagonal) * unit / radius;
}

// block -= a b^T of panels with six rows and at least one column; the columns of the block are
// `stride` apart.
void subtract_product(const double* a, const double* b, Eigen::Index columns, double* block,
                      Eigen::Index stride) {
  using Half = Eigen::Matrix<double, 6, 3>;
  for (Eigen::Index half = 0; half < 2; ++half) {  // as much as registers hold
    const auto product = [&](Eigen::Index k) {
      return Eigen::Map<const Vector6d>(a + 6 * k).lazyProduct(
          Eigen::Map<const Eigen::RowVector3d>(b + 6 * k + 3 * half));
    };
    Half sum = product(0);
    for (Eigen::Index k = 1; k < columns; ++k) sum += product(k);
    Eigen::Map<Half, 0, Eigen::OuterStride<>>(block + 3 * half * stride,
                                              Eigen::OuterStride<>(stride)) -= sum;
  }
}

}  // namespace

void BundleEquations::find_blocks() {
  const BlockPattern& pattern = structure_.pattern;
  std::uint32_t most = 0;
  for (const BundleGroup& group : structure_.groups) {
    first_blocks_.push_back(blocks_.size());
    most = std::max(most, group.row_count());
    for (std::uint32_t i = group.first_row; i < group.end_row; ++i) {
      for (std::uint32_t j = group.first_row; j <= i; ++j) {
        const int column = structure_.group_rows[j];
        blocks_.push_back(
            reduced_.offset(column, pattern.position(column, structure_.group_rows[i])));
      }
    }
  }
  panels_.resize(std::size_t{18} * kPointsAtOnce * most);
}

void BundleEquations::set_scale() {
  const auto unit = [](double diagonal) {
    const double root = 1 + std::sqrt(diagonal);  // Ceres adds 1 to divide by no zero
    return root * root;
  };
  pose_units_.resize(pose_gradient_.size());
  for (Eigen::Index i = 0; i < pose_units_.size(); ++i) {
    pose_units_[i] = unit(pose_information_[static_cast<std::size_t>(i / 6)](i % 6, i % 6));
  }
  point_units_.resize(point_gradient_.size());
  for (Eigen::Index i = 0; i < point_units_.size(); ++i) {
    point_units_[i] = unit(point_information_[static_cast<std::size_t>(i / 3)](i % 3, i % 3));
  }
}

bool BundleEquations::solve(double radius, BundleStep& step) {
  add_poses(radius);
  if (!eliminate_points(radius) || !solve_reduced(step.poses)) return false;
  solve_points(step.poses, step.points);
  judge(radius, step);
  return std::isfinite(model_decrease_);
}

void BundleEquations::add_poses(double radius) {
  reduced_.set_zero();
  reduced_right_ = -pose_gradient_;
  for (int row = 0; row < structure_.rows(); ++row) {
    Matrix6d block = pose_information_[static_cast<std::size_t>(row)];
    for (int k = 0; k < 6; ++k) {
      block(k, k) += damping(block(k, k), pose_units_[6 * row + k], radius);
    }
    reduced_.add_to_diagonal(row, block);
  }
  for (const EdgeBlock& edge : edge_blocks_) {
    if (edge.row_a == BlockPattern::kNone || edge.row_b == BlockPattern::kNone) continue;
    const auto [column, row] = std::minmax(edge.row_a, edge.row_b);
    reduced_.add({column, structure_.pattern.position(column, row), edge.row_a == column},
                 edge.by_both);
  }
}

// L^-1 of the damped information of a point.
bool BundleEquations::halve(std::uint32_t p, double radius) {
  const Eigen::Matrix3d& v = point_information_[p];
  const auto damped = [&](int k) {
    return v(k, k) + damping(v(k, k), point_units_[3 * Eigen::Index{p} + k], radius);
  };
  const double d0 = 1 / std::sqrt(damped(0));
  const double l10 = v(1, 0) * d0;
  const double l20 = v(2, 0) * d0;
  const double d1 = 1 / std::sqrt(damped(1) - l10 * l10);
  const double l21 = (v(2, 1) - l20 * l10) * d1;
  const double d2 = 1 / std::sqrt(damped(2) - l20 * l20 - l21 * l21);
  Eigen::Matrix3d& half = halves_[p];
  half << d0, 0, 0,           //
      -l10 * d0 * d1, d1, 0,  //
      (l10 * l21 * d1 - l20) * d0 * d2, -l21 * d1 * d2, d2;
  return std::isfinite(half.sum());
}

bool BundleEquations::eliminate_points(double radius) {
  for (std::size_t group = 0; group < structure_.groups.size(); ++group) {
    if (!eliminate_group(group, radius)) return false;
  }
  return true;
}

bool BundleEquations::eliminate_group(std::size_t index, double radius) {
  const BundleGroup& group = structure_.groups[index];
  const int* rows = structure_.group_rows.data() + group.first_row;
  constexpr std::uint32_t kPanel = 18 * kPointsAtOnce;
  for (std::uint32_t first = group.first_point; first < group.end_point; first += kPointsAtOnce) {
    const std::uint32_t count = std::min(kPointsAtOnce, group.end_point - first);
    for (std::uint32_t n = 0; n < count; ++n) {
      const std::uint32_t p = first + n;
      if (!halve(p, radius)) return false;
      const Eigen::Vector3d halved = halves_[p] * point_gradient_.segment<3>(3 * Eigen::Index{p});
      for (std::uint32_t k = 0; k < group.row_count(); ++k) {
        Eigen::Map<Block63> u(panels_.data() + std::size_t{kPanel} * k + std::size_t{18} * n);
        u.noalias() = cross_[group.view(p, k)] * halves_[p].transpose();
        reduced_right_.segment<6>(6 * Eigen::Index{rows[k]}).noalias() += u * halved;
      }
    }
    const Eigen::Index* block = blocks_.data() + first_blocks_[index];
    for (std::uint32_t i = 0; i < group.row_count(); ++i) {
      for (std::uint32_t j = 0; j <= i; ++j) {
        subtract_product(panels_.data() + std::size_t{kPanel} * i,
                         panels_.data() + std::size_t{kPanel} * j, 3 * Eigen::Index{count},
                         reduced_.values() + *block++, reduced_.stride(rows[j]));
      }
    }
  }
  return true;
}

bool BundleEquations::solve_reduced(Eigen::VectorXd& step) {
  if (structure_.rows() == 0) {
    step.resize(0);
    return true;
  }
  if (!cholesky_.factorize(reduced_.lower())) return false;
  step = cholesky_.solve(reduced_right_);
  return step.allFinite();
}

void BundleEquations::solve_points(const Eigen::VectorXd& poses, Eigen::VectorXd& points) const {
  points.resize(point_gradient_.size());
  for (const BundleGroup& group : structure_.groups) {
    const int* rows = structure_.group_rows.data() + group.first_row;
    for (std::uint32_t p = group.first_point; p < group.end_point; ++p) {
      Eigen::Vector3d right = point_gradient_.segment<3>(3 * Eigen::Index{p});
      for (std::uint32_t k = 0; k < group.row_count(); ++k) {
        right.noalias() +=
            cross_[group.view(p, k)].transpose() * poses.segment<6>(6 * Eigen::Index{rows[k]});
      }
      const Eigen::Vector3d halved = halves_[p] * right;
      points.segment<3>(3 * Eigen::Index{p}).noalias() = -halves_[p].transpose() * halved;
    }
  }
}

// With (H + D) d = -g the linearised cost falls by -g^T d - d^T H d / 2 = (d^T D d - g^T d) / 2.
void BundleEquations::judge(double radius, const BundleStep& step) {
  double damped = 0;
  for (Eigen::Index i = 0; i < step.poses.size(); ++i) {
    const double diagonal = pose_information_[static_cast<std::size_t>(i / 6)](i % 6, i % 6);
    damped += damping(diagonal, pose_units_[i], radius) * step.poses[i] * step.poses[i];
  }
  for (Eigen::Index i = 0; i < step.points.size(); ++i) {
    const double diagonal = point_information_[static_cast<std::size_t>(i / 3)](i % 3, i % 3);
    damped += damping(diagonal, point_units_[i], radius) * step.points[i] * step.points[i];
  }
  model_decrease_ =
      (damped - pose_gradient_.dot(step.poses) - point_gradient_.dot(step.points)) / 2;
}

}  // namespace hybrid_slam
