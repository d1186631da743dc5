#include "backend/incremental/landmark_term.h"

#include <algorithm>
#include <span>

#include <Eigen/Cholesky>

#include "backend/incremental/front.h"
#include "backend/incremental/scratch.h"
#include "backend/map/prefetch.h"

namespace hybrid_slam {

bool factor_point(const Eigen::Matrix3d& information, Eigen::Matrix3d& factor) {
  // Beyond this ratio of the factor's diagonal the depth is not determined.
  constexpr double kMinRatio = 1e-6;
  const Eigen::LLT<Eigen::Matrix3d> llt(information);
  factor = llt.matrixL();
  return llt.info() == Eigen::Success &&
         factor.diagonal().minCoeff() > kMinRatio * factor.diagonal().maxCoeff();
}

void LandmarkTerm::eliminate() {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (const LandmarkView& view : views) {
    if (!view.usable) continue;
    information.noalias() += view.by_point.transpose() * view.by_point;
    gradient.noalias() += view.by_point.transpose() * view.residual;
  }
  for (const FactorView& view : factors) {
    if (!view.usable) continue;
    information += view.by_point.transpose().lazyProduct(view.by_point);
    gradient += view.by_point.transpose().lazyProduct(view.rows.residual);
  }
  solvable = factor_point(information, factor);
  if (!solvable) return;
  half_solved = factor.triangularView<Eigen::Lower>().solve(gradient);
  for (LandmarkView& view : views) {
    if (!view.usable || view.fixed) continue;
    // Column by column: a solution for all of them together takes longer to set up than to find.
    const Eigen::Matrix<double, 3, 6> cross = view.by_point.transpose() * view.by_pose;
    for (Eigen::Index i = 0; i < 6; ++i) {
      view.reduced.row(i) = factor.triangularView<Eigen::Lower>().solve(cross.col(i)).transpose();
    }
  }
  for (FactorView& view : factors) {
    if (!view.usable) continue;
    view.reduced.resize(view.rows.jacobian.cols(), 3);
    for (Eigen::Index i = 0; i < view.reduced.rows(); ++i) {
      const Eigen::Vector3d cross =
          view.by_point.transpose().lazyProduct(view.rows.jacobian.col(i));
      view.reduced.row(i) = factor.triangularView<Eigen::Lower>().solve(cross).transpose();
    }
  }
}

void FactorView::fetch() const {
  prefetch_all(variables);
  prefetch_all(offsets);
  prefetch_all(rows.jacobian);
  prefetch_all(rows.residual);
  prefetch_all(by_point);
  prefetch_all(reduced);
}

std::size_t LandmarkTerm::usable_count() const {
  const auto is_usable = [](const auto& view) { return view.usable; };
  return static_cast<std::size_t>(std::count_if(views.begin(), views.end(), is_usable) +
                                  std::count_if(factors.begin(), factors.end(), is_usable));
}

void LandmarkTerm::assemble(Front& front) const {
  // What a single view tells is used up by the point; rounding would be all that is left.
  if (!solvable || usable_count() < 2) return;
  if (!factors.empty()) {
    assemble_mixed(front);
    return;
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    const LandmarkView& a = views[i];
    if (!a.usable || a.fixed) continue;
    const std::uint32_t slot_a = front.slot(a.pose);
    const Matrix6d own = a.by_pose.transpose() * a.by_pose;
    front.add(slot_a, slot_a, own - a.reduced * a.reduced.transpose());
    front.add_scale(slot_a, own.diagonal());
    front.add_gradient(slot_a, a.by_pose.transpose() * a.residual - a.reduced * half_solved);
    for (std::size_t j = 0; j < i; ++j) {
      const LandmarkView& b = views[j];
      if (!b.usable || b.fixed) continue;
      const Matrix6d cross = -a.reduced * b.reduced.transpose();
      front.add(slot_a, front.slot(b.pose), cross);
      if (a.pose == b.pose) front.add(slot_a, slot_a, cross.transpose());
    }
  }
}

// The same with factors of any kind. What several views say about a variable is summed up first, so
// that each pair of variables is met once.
void LandmarkTerm::assemble_mixed(Front& front) const {
  const std::size_t count = poses.size();
  Scratch<Eigen::Index, 32> first(count + 1);  // of `poses`
  const std::span<Eigen::Index> offsets(first.data(), count + 1);
  offsets[0] = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t slot = front.slot(poses[i]);
    offsets[i + 1] = offsets[i] + front.row(slot + 1) - front.row(slot);
  }
  const auto row_of = [&](std::uint32_t variable) {
    return offsets[static_cast<std::size_t>(std::find(poses.begin(), poses.end(), variable) -
                                            poses.begin())];
  };
  const Eigen::Index size = offsets[count];
  Scratch<double, 3 * 6 * 16> numbers(3 * static_cast<std::size_t>(size));
  Eigen::Map<Eigen::MatrixX3d> sum(numbers.data(), size, 3);
  sum.setZero();
  for (const LandmarkView& view : views) {
    if (!view.usable || view.fixed) continue;
    const std::uint32_t slot = front.slot(view.pose);
    const Matrix6d own = view.by_pose.transpose() * view.by_pose;
    front.add(slot, slot, own);
    front.add_scale(slot, own.diagonal());
    front.add_gradient(slot, view.by_pose.transpose() * view.residual);
    sum.middleRows<6>(row_of(view.pose)) += view.reduced;
  }
  for (const FactorView& view : factors) {
    if (!view.usable) continue;
    front.add_rows(view.variables, view.offsets, view.rows.jacobian, view.rows.residual);
    for (std::size_t i = 0; i < view.variables.size(); ++i) {
      const Eigen::Index rows = view.offsets[i + 1] - view.offsets[i];
      sum.middleRows(row_of(view.variables[i]), rows) +=
          view.reduced.middleRows(view.offsets[i], rows);
    }
  }
  front.subtract_reduced(poses, offsets, {numbers.data(), size, 3}, half_solved);
}

}  // namespace hybrid_slam
