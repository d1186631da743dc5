#include "backend/incremental/condensed_term.h"

#include <algorithm>
#include <utility>

#include "backend/incremental/front.h"

namespace hybrid_slam {

namespace {

Eigen::Index row(std::size_t slot) { return static_cast<Eigen::Index>(6 * slot); }

}  // namespace

void CondensedTerm::begin(std::vector<std::uint32_t> of, Eigen::VectorXd deltas) {
  poses = std::move(of);
  at = std::move(deltas);
  information.assign(36 * poses.size() * (poses.size() + 1) / 2, 0);
  gradient = Eigen::VectorXd::Zero(at.size());
  reach.assign(poses.size(), {});
  is_held = false;
  placed = at;
  is_stale = false;
  squared_norm = loss_excess = 0;
  rows = 0;
}

std::size_t CondensedTerm::slot(std::uint32_t pose) const {
  return static_cast<std::size_t>(std::find(poses.begin(), poses.end(), pose) - poses.begin());
}

Eigen::Map<Matrix6d> CondensedTerm::block(std::size_t i, std::size_t j) {
  return Eigen::Map<Matrix6d>(information.data() + 36 * (i * (i + 1) / 2 + j));
}

Eigen::Map<const Matrix6d> CondensedTerm::block(std::size_t i, std::size_t j) const {
  return Eigen::Map<const Matrix6d>(information.data() + 36 * (i * (i + 1) / 2 + j));
}

// The landmark's displacement is left at its optimum: what its views add is
//   |r|^2 - |L^-1 sum by_point^T r|^2, with r the residuals without a displacement.
void CondensedTerm::add(const LandmarkTerm& landmark, double cost) {
  if (!landmark.solvable || landmark.usable_count() < 2) return;
  double norm = 0;
  Eigen::Vector3d half_solved = landmark.half_solved;
  std::vector<std::pair<std::size_t, const LandmarkView*>> varying;
  std::vector<Eigen::Vector3d> residuals;
  for (const LandmarkView& view : landmark.views) {
    if (!view.usable) continue;
    Eigen::Vector3d residual = view.residual;
    if (view.fixed) {
      is_held = true;
    } else {
      const std::size_t i = slot(view.pose);
      const auto delta = at.segment<6>(row(i));
      residual.noalias() += view.by_pose * delta;
      half_solved.noalias() += view.reduced.transpose() * delta;
      varying.emplace_back(i, &view);
      residuals.push_back(residual);
    }
    norm += residual.squaredNorm();
    rows += view.by_point.row(2).isZero(0) ? 2 : 3;
  }
  norm -= half_solved.squaredNorm();
  squared_norm += norm;
  loss_excess += cost - norm;
  for (std::size_t a = 0; a < varying.size(); ++a) {
    const auto& [i, view] = varying[a];
    const Matrix6d own = view->by_pose.transpose() * view->by_pose;
    block(i, i) += own - view->reduced * view->reduced.transpose();
    gradient.segment<6>(row(i)) +=
        view->by_pose.transpose() * residuals[a] - view->reduced * half_solved;
    reach[i].by_way += own.diagonal().head<3>().sum();
    reach[i].by_turn += own.diagonal().tail<3>().sum();
    ++reach[i].views;
    for (std::size_t b = 0; b < a; ++b) {
      const auto& [j, other] = varying[b];
      const Matrix6d cross = -view->reduced * other->reduced.transpose();
      if (i >= j) block(i, j) += cross;
      if (i <= j) block(j, i) += cross.transpose();
    }
  }
}

Eigen::VectorXd CondensedTerm::times(const Eigen::VectorXd& v) const {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(v.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    result.segment<6>(row(i)).noalias() += block(i, i) * v.segment<6>(row(i));
    for (std::size_t j = 0; j < i; ++j) {
      result.segment<6>(row(i)).noalias() += block(i, j) * v.segment<6>(row(j));
      result.segment<6>(row(j)).noalias() += block(i, j).transpose() * v.segment<6>(row(i));
    }
  }
  return result;
}

void CondensedTerm::assemble(Front& front) const {
  const Eigen::VectorXd at_zero = gradient - times(at);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::uint32_t slot_i = front.slot(poses[i]);
    for (std::size_t j = 0; j <= i; ++j) front.add(slot_i, front.slot(poses[j]), block(i, j));
    front.add_gradient(slot_i, at_zero.segment<6>(row(i)));
    Vector6d scale;
    scale.head<3>().setConstant(reach[i].by_way);
    scale.tail<3>().setConstant(reach[i].by_turn);
    front.add_scale(slot_i, scale);
  }
}

}  // namespace hybrid_slam
