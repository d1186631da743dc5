#include <algorithm>

#include "backend/incremental/pose_tree.h"

// Back-substitution in a PoseTree, and the deltas that it gives.

namespace hybrid_slam {

// Whether a variable, solved by a clique's factor from this row on, moved by more than is worth
// telling.
bool PoseTree::has_changed(const Eigen::MatrixXd& factor, std::uint32_t variable, Eigen::Index row,
                           double threshold) const {
  const Eigen::Map<const Eigen::VectorXd> sent(sent_.data() + offset_[variable], size(variable));
  if (is_pose_[variable] != 0) {
    return (delta_of(variable) - sent).lpNorm<Eigen::Infinity>() > threshold;
  }
  const Eigen::VectorXd way = delta_of(variable) - sent;
  const auto root = factor.block(row, row, way.size(), way.size());
  const Eigen::VectorXd in_sigmas = root.triangularView<Eigen::Lower>().transpose() * way;
  return in_sigmas.norm() > (is_shared(variable) ? options_.shared_share : options_.share);
}

// What the frontals' triangle is solved for, with the deltas of the separator as they are.
Eigen::VectorXd PoseTree::right_side(const Clique& clique, const Eigen::MatrixXd& factor) const {
  const Eigen::Index f = factor.cols();
  const Eigen::Index s = clique.separator_rows();
  Eigen::VectorXd right = -factor.row(f + s).transpose();
  if (s > 0) {
    Eigen::VectorXd separator(s);
    Eigen::Index row = 0;
    for (const std::uint32_t pose : clique.separator) {
      separator.segment(row, size(pose)) = delta_of(pose);
      row += size(pose);
    }
    right.noalias() -= factor.middleRows(f, s).transpose() * separator;
  }
  return right;
}

// Solves for the shared variables at the end of the frontals, in place. Returns the row where they
// begin. What is shared stays where it is until that is worth telling all others, and they are
// solved for with it there: those in this clique, too, or the motion would reach everything by
// them.
Eigen::Index PoseTree::solve_shared(const Clique& clique, const Eigen::MatrixXd& factor,
                                    double threshold, Eigen::VectorXd& right) {
  Eigen::Index rest = factor.cols();
  for (std::size_t i = clique.frontals.size(); i-- > 0 && is_shared(clique.frontals[i]);) {
    const std::uint32_t variable = clique.frontals[i];
    const Eigen::Index first = rest - size(variable);
    auto value = right.segment(first, rest - first);
    factor.block(first, first, rest - first, rest - first)
        .triangularView<Eigen::Lower>()
        .transpose()
        .solveInPlace(value);
    const Eigen::VectorXd before = delta_of(variable);
    values(delta_, variable) = value;
    if (!has_changed(factor, variable, first, threshold)) value = before;
    values(delta_, variable) = before;
    right.head(first).noalias() -= factor.block(first, 0, rest - first, first).transpose() * value;
    rest = first;
  }
  return rest;
}

// Makes what was solved for the deltas of the frontals.
void PoseTree::take(const Clique& clique, const Eigen::MatrixXd& factor,
                    const Eigen::VectorXd& solved, double threshold,
                    std::vector<std::uint32_t>& changed) {
  const bool finite = solved.allFinite();
  Eigen::Index row = 0;
  for (const std::uint32_t pose : clique.frontals) {
    auto delta = values(delta_, pose);
    auto sent = values(sent_, pose);
    solved_variables_.push_back(pose);
    before_.insert(before_.end(), delta.begin(), delta.end());
    before_.insert(before_.end(), sent.begin(), sent.end());
    if (finite) delta = solved.segment(row, size(pose));
    if (has_changed(factor, pose, row, threshold)) {
      sent = delta;
      moved_[pose] = 1;
      changed.push_back(pose);
    }
    row += size(pose);
  }
}

void PoseTree::solve_clique(Clique& clique, double threshold, std::vector<std::uint32_t>& changed) {
  const Eigen::MatrixXd& factor = factor_of(clique, wide_);
  Eigen::VectorXd right = right_side(clique, factor);
  const Eigen::Index rest = solve_shared(clique, factor, threshold, right);
  auto others = right.head(rest);
  factor.topLeftCorner(rest, rest).triangularView<Eigen::Lower>().transpose().solveInPlace(others);
  take(clique, factor, right, threshold, changed);
  clique.fresh = false;
}

void PoseTree::solve(double threshold, std::vector<std::uint32_t>& changed) {
  const std::size_t first = changed.size();
  before_.clear();
  solved_variables_.clear();
  solved_.clear();
  std::vector<std::int32_t> stack;
  for (std::size_t i = 0; i < cliques_.size(); ++i) {
    if (!cliques_[i].frontals.empty() && cliques_[i].parent == kNone) {
      stack.push_back(static_cast<std::int32_t>(i));
    }
  }
  while (!stack.empty()) {
    const std::int32_t index = stack.back();
    Clique& clique = at(index);
    stack.pop_back();
    const bool moved = std::any_of(clique.separator.begin(), clique.separator.end(),
                                   [&](std::uint32_t pose) { return moved_[pose] != 0; });
    if (!clique.fresh && !moved) continue;
    solve_clique(clique, threshold, changed);
    solved_.push_back(index);
    stack.insert(stack.end(), clique.children.begin(), clique.children.end());
  }
  for (std::size_t i = first; i < changed.size(); ++i) moved_[changed[i]] = 0;
}

bool PoseTree::renew(std::uint32_t variable) {
  if (clique_of_[variable] != kNone) return false;
  values(delta_, variable).setZero();
  values(sent_, variable).setZero();
  damping_[variable] = 0;
  return true;
}

void PoseTree::shift(std::uint32_t pose, const Vector6d& by) {
  values(delta_, pose) += by;
  values(sent_, pose) = delta_of(pose);
  for (std::int32_t i = clique_of_[pose]; i != kNone && !at(i).fresh; i = at(i).parent) {
    at(i).fresh = true;
  }
}

void PoseTree::undo_solve() {
  const double* value = before_.data();
  for (const std::uint32_t variable : solved_variables_) {
    for (std::vector<double>* of_all : {&delta_, &sent_}) {
      std::copy_n(value, size_[variable], of_all->data() + offset_[variable]);
      value += size_[variable];
    }
  }
  for (const std::int32_t index : solved_) at(index).fresh = true;
  before_.clear();
  solved_variables_.clear();
  solved_.clear();
}

}  // namespace hybrid_slam
