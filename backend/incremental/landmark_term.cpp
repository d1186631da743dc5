#include "backend/incremental/landmark_term.h"

#include <algorithm>

#include <Eigen/Cholesky>

#include "backend/incremental/front.h"

namespace hybrid_slam {

void LandmarkTerm::eliminate() {
  // Beyond this ratio of the factor's diagonal the depth is not determined.
  constexpr double kMinRatio = 1e-6;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (const LandmarkView& view : views) {
    if (!view.usable) continue;
    information.noalias() += view.by_point.transpose() * view.by_point;
    gradient.noalias() += view.by_point.transpose() * view.residual;
  }
  for (const FactorView& view : factors) {
    if (!view.usable) continue;
    information.noalias() += view.by_point.transpose() * view.by_point;
    gradient.noalias() += view.by_point.transpose() * view.rows.residual;
  }
  const Eigen::LLT<Eigen::Matrix3d> llt(information);
  factor = llt.matrixL();
  solvable = llt.info() == Eigen::Success &&
             factor.diagonal().minCoeff() > kMinRatio * factor.diagonal().maxCoeff();
  if (!solvable) return;
  half_solved = factor.triangularView<Eigen::Lower>().solve(gradient);
  for (LandmarkView& view : views) {
    if (!view.usable || view.fixed) continue;
    const Eigen::Matrix<double, 3, 6> cross = view.by_point.transpose() * view.by_pose;
    view.reduced = factor.triangularView<Eigen::Lower>().solve(cross).transpose();
  }
  for (FactorView& view : factors) {
    if (!view.usable) continue;
    const Eigen::Matrix<double, 3, Eigen::Dynamic> cross =
        view.by_point.transpose() * view.rows.jacobian;
    view.reduced = factor.triangularView<Eigen::Lower>().solve(cross).transpose();
  }
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

// The same with factors of any kind: what several views say about a variable is summed up first.
void LandmarkTerm::assemble_mixed(Front& front) const {
  std::vector<Eigen::Index> offsets{0};  // of `poses`
  for (const std::uint32_t variable : poses) {
    const std::uint32_t slot = front.slot(variable);
    offsets.push_back(offsets.back() + front.row(slot + 1) - front.row(slot));
  }
  const auto row_of = [&](std::uint32_t variable) {
    return offsets[static_cast<std::size_t>(std::find(poses.begin(), poses.end(), variable) -
                                            poses.begin())];
  };
  const Eigen::Index size = offsets.back();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
  Eigen::MatrixX3d reduced = Eigen::MatrixX3d::Zero(size, 3);
  for (const LandmarkView& view : views) {
    if (!view.usable || view.fixed) continue;
    const Eigen::Index row = row_of(view.pose);
    information.block<6, 6>(row, row) += view.by_pose.transpose() * view.by_pose;
    gradient.segment<6>(row) += view.by_pose.transpose() * view.residual;
    reduced.middleRows<6>(row) += view.reduced;
  }
  for (const FactorView& view : factors) {
    if (!view.usable) continue;
    const Eigen::MatrixXd own = view.rows.jacobian.transpose() * view.rows.jacobian;
    const Eigen::VectorXd slope = view.rows.jacobian.transpose() * view.rows.residual;
    for (std::size_t i = 0; i < view.variables.size(); ++i) {
      const Eigen::Index row = row_of(view.variables[i]);
      const Eigen::Index rows = view.offsets[i + 1] - view.offsets[i];
      gradient.segment(row, rows) += slope.segment(view.offsets[i], rows);
      reduced.middleRows(row, rows) += view.reduced.middleRows(view.offsets[i], rows);
      for (std::size_t j = 0; j < view.variables.size(); ++j) {
        const Eigen::Index columns = view.offsets[j + 1] - view.offsets[j];
        information.block(row, row_of(view.variables[j]), rows, columns) +=
            own.block(view.offsets[i], view.offsets[j], rows, columns);
      }
    }
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Index rows = offsets[i + 1] - offsets[i];
    front.add_scale(front.slot(poses[i]), information.diagonal().segment(offsets[i], rows));
  }
  information.noalias() -= reduced * reduced.transpose();
  gradient.noalias() -= reduced * half_solved;
  front.add_dense(poses, offsets, information, gradient);
}

}  // namespace hybrid_slam
