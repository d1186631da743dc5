#include "backend/incremental/condensed_term.h"

#include <algorithm>
#include <utility>

#include "backend/incremental/front.h"
#include "cameras/geometry/se3.h"

namespace hybrid_slam {

namespace {

Eigen::Index row(std::size_t slot) { return static_cast<Eigen::Index>(6 * slot); }

}  // namespace

void CondensedTerm::begin(std::vector<std::uint32_t> of, Eigen::VectorXd deltas) {
  poses = std::move(of);
  at = std::move(deltas);
  own.assign(poses.size(), Matrix6d::Zero());
  shared.clear();
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

Matrix6d CondensedTerm::shared_block(std::size_t i, std::size_t j) const {
  Matrix6d block;
  std::copy_n(shared[place_of(i, j)].data(), block.size(), block.data());
  return block;
}

void CondensedTerm::add(std::span<const LandmarkTerm* const> landmarks,
                        std::span<const double> costs, std::span<const Eigen::Vector3d> places) {
  Sums sums(poses.size() * (poses.size() - 1) / 2, Matrix6d::Zero());
  for (std::size_t k = 0; k < landmarks.size(); ++k) add(*landmarks[k], costs[k], sums);
  keep(sums, places);
}

// Blocks between poses are most of the memory, and are kept in single precision. What that takes
// off them would tie the poses to where they are: with each pose's own block made up for it, the
// sum says nothing, as before, about a motion that they have in common, so that it is their shape
// alone that some 1e-7 of its stiffness are missing to.
void CondensedTerm::keep(const Sums& sums, std::span<const Eigen::Vector3d> places) {
  shared.resize(sums.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      shared[place_of(i, j)] = sums[place_of(i, j)].cast<float>();
      const Matrix6d lost = sums[place_of(i, j)] - shared_block(i, j);
      // A common motion as increments of j, by those of i.
      Matrix6d of_j = Matrix6d::Identity();
      of_j.topRightCorner<3, 3>() = hat(places[i] - places[j]);
      const Matrix6d to_i = lost * of_j;
      of_j.topRightCorner<3, 3>() *= -1;
      const Matrix6d to_j = lost.transpose() * of_j;
      own[i] += 0.5 * (to_i + to_i.transpose());
      own[j] += 0.5 * (to_j + to_j.transpose());
    }
  }
}

// The landmark's displacement is left at its optimum: what its views add is
//   |r|^2 - |L^-1 sum by_point^T r|^2, with r the residuals without a displacement.
void CondensedTerm::add(const LandmarkTerm& landmark, double cost, Sums& sums) {
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
    const Matrix6d direct = view->by_pose.transpose() * view->by_pose;
    own[i] += direct - view->reduced * view->reduced.transpose();
    gradient.segment<6>(row(i)) +=
        view->by_pose.transpose() * residuals[a] - view->reduced * half_solved;
    reach[i].by_way += direct.diagonal().head<3>().sum();
    reach[i].by_turn += direct.diagonal().tail<3>().sum();
    ++reach[i].views;
    for (std::size_t b = 0; b < a; ++b) {
      const auto& [j, other] = varying[b];
      const Matrix6d cross = -view->reduced * other->reduced.transpose();
      if (i > j) sums[place_of(i, j)] += cross;
      if (i < j) sums[place_of(j, i)] += cross.transpose();
      if (i == j) own[i] += cross + cross.transpose();
    }
  }
}

Eigen::VectorXd CondensedTerm::times(const Eigen::VectorXd& v) const {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(v.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    result.segment<6>(row(i)).noalias() += own[i] * v.segment<6>(row(i));
    for (std::size_t j = 0; j < i; ++j) {
      const Matrix6d block = shared_block(i, j);
      result.segment<6>(row(i)).noalias() += block * v.segment<6>(row(j));
      result.segment<6>(row(j)).noalias() += block.transpose() * v.segment<6>(row(i));
    }
  }
  return result;
}

void CondensedTerm::assemble(Front& front) const {
  const Eigen::VectorXd at_zero = gradient - times(at);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::uint32_t slot_i = front.slot(poses[i]);
    front.add(slot_i, slot_i, own[i]);
    for (std::size_t j = 0; j < i; ++j) {
      front.add(slot_i, front.slot(poses[j]), shared_block(i, j));
    }
    front.add_gradient(slot_i, at_zero.segment<6>(row(i)));
    Vector6d scale;
    scale.head<3>().setConstant(reach[i].by_way);
    scale.tail<3>().setConstant(reach[i].by_turn);
    front.add_scale(slot_i, scale);
  }
}

}  // namespace hybrid_slam
