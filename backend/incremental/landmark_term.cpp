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
}

void LandmarkTerm::assemble(Front& front) const {
  // What a single view tells is used up by the point; rounding would be all that is left.
  if (!solvable || std::count_if(views.begin(), views.end(),
                                 [](const LandmarkView& view) { return view.usable; }) < 2) {
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

}  // namespace hybrid_slam
