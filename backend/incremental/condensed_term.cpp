#include "backend/incremental/condensed_term.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "backend/incremental/front.h"
#include "cameras/geometry/se3.h"

namespace hybrid_slam {

namespace {

Eigen::Index row(std::size_t slot) { return static_cast<Eigen::Index>(6 * slot); }

std::size_t pairs(std::size_t poses) { return poses * (poses - 1) / 2; }

constexpr std::size_t kSharedBytes = sizeof(Eigen::Matrix<float, 6, 6>);
constexpr std::size_t kReducedBytes = sizeof(CondensedTerm::Reduced);
// Of a pose: its own block, gradient, two deltas, reach and number.
constexpr std::size_t kPoseBytes =
    sizeof(Matrix6d) + 3 * sizeof(Vector6d) + sizeof(CondensedTerm::Reach) + sizeof(std::uint32_t);

bool is_used(const LandmarkTerm& landmark) {
  return landmark.solvable && landmark.usable_count() >= 2;
}

}  // namespace

std::size_t CondensedTerm::bytes(std::size_t poses, std::size_t views) {
  return poses * kPoseBytes + std::min(pairs(poses) * kSharedBytes, views * kReducedBytes);
}

std::span<const std::uint32_t> CondensedTerm::observations_of(std::size_t member) const {
  const std::size_t first = members[member].first;
  const std::size_t end =
      member + 1 < members.size() ? members[member + 1].first : observations.size();
  return std::span(observations).subspan(first, end - first);
}

void CondensedTerm::order_members() {
  std::vector<std::size_t> order(members.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
    return members[a].landmark < members[b].landmark;
  });
  std::vector<Member> ordered;
  std::vector<std::uint32_t> their_observations;
  ordered.reserve(members.size());
  their_observations.reserve(observations.size());
  for (const std::size_t i : order) {
    const auto seen = observations_of(i);
    ordered.push_back(members[i]);
    ordered.back().first = static_cast<std::uint32_t>(their_observations.size());
    their_observations.insert(their_observations.end(), seen.begin(), seen.end());
  }
  members = std::move(ordered);
  observations = std::move(their_observations);
}

void CondensedTerm::begin(std::vector<std::uint32_t> of, Eigen::VectorXd deltas) {
  poses = std::move(of);
  at = std::move(deltas);
  own.assign(poses.size(), Matrix6d::Zero());
  shared.clear();
  reduced.clear();
  reduced_first.clear();
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

std::span<const CondensedTerm::Reduced> CondensedTerm::reduced_of(std::size_t landmark) const {
  return std::span(reduced).subspan(reduced_first[landmark],
                                    reduced_first[landmark + 1] - reduced_first[landmark]);
}

// What was said of the poses goes along with them.
void CondensedTerm::widen(std::vector<std::uint32_t> all, const Eigen::VectorXd& new_at,
                          const Eigen::VectorXd& new_placed) {
  const CondensedTerm before = std::move(*this);
  begin(std::move(all), new_at);
  placed = new_placed;
  members = before.members;
  observations = before.observations;
  is_held = before.is_held;
  is_stale = before.is_stale;
  squared_norm = before.squared_norm;
  loss_excess = before.loss_excess;
  rows = before.rows;
  reduced = before.reduced;
  reduced_first = before.reduced_first;
  if (!before.shared.empty()) {
    shared.assign(pairs(poses.size()), Eigen::Matrix<float, 6, 6>::Zero());
  }
  std::vector<std::size_t> slot_of;
  for (std::size_t i = 0; i < before.poses.size(); ++i) {
    const std::size_t to = slot(before.poses[i]);
    slot_of.push_back(to);
    own[to] = before.own[i];
    reach[to] = before.reach[i];
    gradient.segment<6>(row(to)) = before.gradient.segment<6>(row(i));
    at.segment<6>(row(to)) = before.at.segment<6>(row(i));
    placed.segment<6>(row(to)) = before.placed.segment<6>(row(i));
    for (std::size_t j = 0; j < i && !shared.empty(); ++j) {
      shared[place_of(to, slot_of[j])] = before.shared[place_of(i, j)];
    }
  }
  for (Reduced& one : reduced) one.slot = static_cast<std::uint32_t>(slot_of[one.slot]);
}

// Costs are those of the estimate, which is no longer where an older term was made.
void CondensedTerm::add(std::span<const LandmarkTerm* const> landmarks,
                        std::span<const double> costs, std::span<const Eigen::Vector3d> places,
                        const Eigen::VectorXd& now) {
  loss_excess += squared_norm_at(now);
  Sums sums(pairs(poses.size()), Matrix6d::Zero());
  std::size_t views = reduced.size();
  for (std::size_t k = 0; k < landmarks.size(); ++k) {
    if (!is_used(*landmarks[k])) continue;
    add(*landmarks[k], sums);
    loss_excess += costs[k];
    views += landmarks[k]->views.size();
  }
  if (shared.empty() && views * kReducedBytes < sums.size() * kSharedBytes) {
    reduced.reserve(views);
    if (reduced_first.empty()) reduced_first.push_back(0);
    for (const LandmarkTerm* landmark : landmarks) add_reduced(*landmark, sums);
  } else {
    add_known(sums);
    keep(sums);
  }
  make_up_for(sums, places);
  loss_excess -= squared_norm_at(now);
}

// The blocks that are there already.
void CondensedTerm::add_known(Sums& sums) const {
  for (std::size_t k = 0; k < shared.size(); ++k) sums[k] += shared[k].cast<double>();
  for (std::size_t k = 0; k + 1 < reduced_first.size(); ++k) {
    const std::span<const Reduced> seen = reduced_of(k);
    for (const Reduced& a : seen) {
      for (const Reduced& b : seen) {
        if (a.slot <= b.slot) continue;
        sums[place_of(a.slot, b.slot)] -=
            a.by_pose.cast<double>() * b.by_pose.cast<double>().transpose();
      }
    }
  }
}

// Keeps the sums, and leaves in them what single precision takes off.
void CondensedTerm::keep(Sums& sums) {
  reduced = {};
  reduced_first = {};
  shared.resize(sums.size());
  for (std::size_t k = 0; k < sums.size(); ++k) {
    shared[k] = sums[k].cast<float>();
    sums[k] -= shared[k].cast<double>();
  }
}

// Likewise, as what the landmark leaves.
void CondensedTerm::add_reduced(const LandmarkTerm& landmark, Sums& sums) {
  const std::size_t first = reduced_first.back();
  for (const LandmarkView& view : landmark.views) {
    if (!is_used(landmark) || !view.usable || view.fixed) continue;
    const auto i = static_cast<std::uint32_t>(slot(view.pose));
    const auto known = std::find_if(reduced.begin() + static_cast<std::ptrdiff_t>(first),
                                    reduced.end(), [i](const Reduced& of) { return of.slot == i; });
    if (known == reduced.end()) {
      reduced.push_back({i, view.reduced.cast<float>()});
    } else {
      known->by_pose += view.reduced.cast<float>();
    }
  }
  for (std::size_t a = first; a < reduced.size(); ++a) {
    for (std::size_t b = first; b < reduced.size(); ++b) {
      if (reduced[a].slot <= reduced[b].slot) continue;
      sums[place_of(reduced[a].slot, reduced[b].slot)] +=
          reduced[a].by_pose.cast<double>() * reduced[b].by_pose.cast<double>().transpose();
    }
  }
  reduced_first.push_back(static_cast<std::uint32_t>(reduced.size()));
}

// What is between poses is most of the memory, and is kept in single precision. What that takes
// off would tie the poses to where they are: with each pose's own block made up for it, the
// sum says nothing, as before, about a motion that they have in common, so that it is their shape
// alone that some 1e-7 of its stiffness are missing to.
void CondensedTerm::make_up_for(const Sums& lost, std::span<const Eigen::Vector3d> places) {
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (lost[place_of(i, j)].isZero(0)) continue;
      // A common motion as increments of j, by those of i.
      Matrix6d of_j = Matrix6d::Identity();
      of_j.topRightCorner<3, 3>() = hat(places[i] - places[j]);
      const Matrix6d to_i = lost[place_of(i, j)] * of_j;
      of_j.topRightCorner<3, 3>() *= -1;
      const Matrix6d to_j = lost[place_of(i, j)].transpose() * of_j;
      own[i] += 0.5 * (to_i + to_i.transpose());
      own[j] += 0.5 * (to_j + to_j.transpose());
    }
  }
}

// The landmark's displacement is left at its optimum: what its views add is
//   |r|^2 - |L^-1 sum by_point^T r|^2, with r the residuals without a displacement.
void CondensedTerm::add(const LandmarkTerm& landmark, Sums& sums) {
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

double CondensedTerm::squared_norm_at(const Eigen::VectorXd& deltas) const {
  const Eigen::VectorXd moved = deltas - at;
  return squared_norm + moved.dot(2 * gradient + times(moved));
}

Eigen::VectorXd CondensedTerm::times(const Eigen::VectorXd& v) const {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(v.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    result.segment<6>(row(i)).noalias() += own[i] * v.segment<6>(row(i));
    for (std::size_t j = 0; j < i && !shared.empty(); ++j) {
      const Matrix6d block = shared_block(i, j);
      result.segment<6>(row(i)).noalias() += block * v.segment<6>(row(j));
      result.segment<6>(row(j)).noalias() += block.transpose() * v.segment<6>(row(i));
    }
  }
  std::vector<Eigen::Vector3d> of_pose;
  for (std::size_t k = 0; k + 1 < reduced_first.size(); ++k) {
    const std::span<const Reduced> seen = reduced_of(k);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    of_pose.clear();
    for (const Reduced& one : seen) {
      of_pose.emplace_back(one.by_pose.cast<double>().transpose() * v.segment<6>(row(one.slot)));
      sum += of_pose.back();
    }
    for (std::size_t a = 0; a < seen.size(); ++a) {
      result.segment<6>(row(seen[a].slot)).noalias() -=
          seen[a].by_pose.cast<double>() * (sum - of_pose[a]);
    }
  }
  return result;
}

void CondensedTerm::assemble(Front& front) const {
  const Eigen::VectorXd at_zero = gradient - times(at);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::uint32_t slot_i = front.slot(poses[i]);
    front.add(slot_i, slot_i, own[i]);
    for (std::size_t j = 0; j < i && !shared.empty(); ++j) {
      front.add(slot_i, front.slot(poses[j]), shared_block(i, j));
    }
    front.add_gradient(slot_i, at_zero.segment<6>(row(i)));
    Vector6d scale;
    scale.head<3>().setConstant(reach[i].by_way);
    scale.tail<3>().setConstant(reach[i].by_turn);
    front.add_scale(slot_i, scale);
  }
  for (std::size_t k = 0; k + 1 < reduced_first.size(); ++k) assemble_reduced(k, front);
}

// What a landmark leaves between the poses that see it.
void CondensedTerm::assemble_reduced(std::size_t landmark, Front& front) const {
  const std::span<const Reduced> seen = reduced_of(landmark);
  std::vector<Eigen::Matrix<double, 6, 3>> wide;
  for (const Reduced& one : seen) {
    wide.emplace_back(one.by_pose.cast<double>());
    const std::uint32_t slot_a = front.slot(poses[one.slot]);
    for (std::size_t b = 0; b + 1 < wide.size(); ++b) {
      const Matrix6d block = -wide.back() * wide[b].transpose();
      front.add(slot_a, front.slot(poses[seen[b].slot]), block);
    }
  }
}

}  // namespace hybrid_slam
