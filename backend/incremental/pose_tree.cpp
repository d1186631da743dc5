#include "backend/incremental/pose_tree.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>

#include "backend/incremental/elimination_order.h"

namespace hybrid_slam {

namespace {

constexpr std::uint32_t kOutside = std::numeric_limits<std::uint32_t>::max();

// A pivot below this part of what terms added to its diagonal is rounding: some thousand
// eliminations, one after another, each with the precision of a double.
constexpr double kPivotRounding = 1e-12;

void sort_unique(std::vector<std::uint32_t>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

// Multiplications of a partial Cholesky of f of f + s rows.
double factor_cost(Eigen::Index frontals, Eigen::Index separator) {
  const auto f = static_cast<double>(frontals);
  const auto s = static_cast<double>(separator);
  return f * f * f / 6 + f * f * s / 2 + f * s * s / 2;
}

// What a diagonal entry of a front is measured by.
double unit_of(Front& front, Eigen::Index i) {
  return std::max(front.scale()[i], front.matrix()(i, i));
}

}  // namespace

void PoseTree::resize(std::size_t poses) {
  while (clique_of_.size() < poses) {
    add(6, false);
    is_pose_.back() = 1;
  }
}

void PoseTree::add(std::size_t size, bool shared) {
  clique_of_.push_back(kNone);
  size_.push_back(static_cast<std::uint32_t>(size));
  offset_.push_back(delta_.size());
  is_pose_.push_back(0);
  shared_.push_back(shared ? 1 : 0);
  any_shared_ = any_shared_ || shared;
  all_poses_ = all_poses_ && size == 6;
  delta_.resize(delta_.size() + size, 0);
  sent_.resize(delta_.size(), 0);
  moved_.push_back(0);
  damping_.push_back(0);
  local_.push_back(kOutside);
  slot_of_.push_back(0);
}

double PoseTree::cost_of(std::span<const std::uint32_t> poses, std::vector<char>& marked) const {
  marked.resize(std::max(marked.size(), cliques_.size()), 0);
  double cost = 0;
  for (const std::uint32_t pose : poses) {
    for (std::int32_t i = clique_of_[pose]; i != kNone; i = at(i).parent) {
      char& mark = marked[static_cast<std::size_t>(i)];
      if (mark != 0) break;
      mark = 1;
      cost += factor_cost(at(i).factor.cols(), at(i).separator_rows());
    }
  }
  return cost;
}

bool PoseTree::is_marked(std::span<const std::uint32_t> poses,
                         const std::vector<char>& marked) const {
  return std::all_of(poses.begin(), poses.end(), [&](std::uint32_t pose) {
    const std::int32_t clique = clique_of_[pose];
    return clique != kNone && marked[static_cast<std::size_t>(clique)] != 0;
  });
}

std::int32_t PoseTree::make_clique() {
  if (free_.empty()) {
    cliques_.emplace_back();
    return static_cast<std::int32_t>(cliques_.size()) - 1;
  }
  const std::int32_t index = free_.back();
  free_.pop_back();
  at(index) = Clique();
  return index;
}

// Takes the cliques of these poses and all above out of the tree. Returns their poses, ascending.
std::vector<std::uint32_t> PoseTree::detach(const std::vector<std::uint32_t>& touched,
                                            std::vector<std::int32_t>& orphans) {
  std::vector<std::int32_t> removed;
  std::vector<std::uint32_t> poses = touched;
  for (const std::uint32_t pose : touched) {
    for (std::int32_t i = clique_of_[pose]; i != kNone;) {
      Clique& clique = at(i);
      if (clique.frontals.empty()) break;  // removed already
      poses.insert(poses.end(), clique.frontals.begin(), clique.frontals.end());
      clique.frontals.clear();
      removed.push_back(i);
      i = clique.parent;
    }
  }
  for (const std::int32_t i : removed) {
    for (const std::int32_t child : at(i).children) {
      if (!at(child).frontals.empty()) orphans.push_back(child);
    }
  }
  std::sort(orphans.begin(), orphans.end());
  for (const std::int32_t i : removed) at(i) = Clique();
  free_.insert(free_.end(), removed.begin(), removed.end());
  sort_unique(poses);
  for (const std::uint32_t pose : poses) clique_of_[pose] = kNone;
  return poses;
}

// Terms of which every pose is among these (local_ is set): the others belong to subtrees below.
std::vector<std::uint32_t> PoseTree::terms_inside(const std::vector<std::uint32_t>& poses,
                                                  const TermSource& terms) const {
  std::vector<std::uint32_t> inside;
  for (const std::uint32_t pose : poses) {
    for (const std::uint32_t term : terms.terms_of(pose)) {
      const auto members = terms.poses_of(term);
      // Once: at the first of its poses, or the first that is not shared.
      const auto first = [&] {
        if (!any_shared_) return *std::min_element(members.begin(), members.end());
        return *std::min_element(members.begin(), members.end(),
                                 [this](std::uint32_t a, std::uint32_t b) {
                                   return std::pair(shared_[a], a) < std::pair(shared_[b], b);
                                 });
      };
      if (first() != pose) continue;
      if (std::all_of(members.begin(), members.end(),
                      [&](std::uint32_t member) { return local_[member] != kOutside; })) {
        inside.push_back(term);
      }
    }
  }
  sort_unique(inside);
  return inside;
}

std::vector<std::int32_t> PoseTree::build_cliques(const std::vector<std::uint32_t>& poses,
                                                  const std::vector<std::uint32_t>& inside,
                                                  const std::vector<std::int32_t>& orphans,
                                                  const std::vector<std::uint32_t>& newest,
                                                  const TermSource& terms) {
  std::vector<std::vector<std::uint32_t>> adjacency(poses.size());
  const auto connect = [&](std::span<const std::uint32_t> members) {
    for (const std::uint32_t a : members) {
      for (const std::uint32_t b : members) {
        if (a != b) adjacency[local_[a]].push_back(local_[b]);
      }
    }
  };
  for (const std::uint32_t term : inside) connect(terms.poses_of(term));
  for (const std::int32_t orphan : orphans) connect(at(orphan).separator);
  for (auto& neighbours : adjacency) sort_unique(neighbours);
  std::vector<char> last(poses.size(), 0);
  for (const std::uint32_t pose : newest) {
    if (local_[pose] != kOutside) last[local_[pose]] = 1;
  }
  std::vector<std::uint32_t> sizes;
  if (!all_poses_) {
    for (const std::uint32_t pose : poses) {
      sizes.push_back(size_[pose]);
      if (is_shared(pose)) last[local_[pose]] = 2;
    }
  }

  const auto eliminated = eliminate(adjacency, last, options_.max_padding, sizes);
  std::vector<std::int32_t> made;
  made.reserve(eliminated.size());
  for (const EliminationClique& wanted : eliminated) {
    const std::int32_t index = make_clique();
    made.push_back(index);
    Clique& clique = at(index);
    for (const std::uint32_t v : wanted.frontals) clique.frontals.push_back(poses[v]);
    for (const std::uint32_t v : wanted.separator) clique.separator.push_back(poses[v]);
    if (wanted.parent >= 0) {
      clique.parent = made[static_cast<std::size_t>(wanted.parent)];
      at(clique.parent).children.push_back(index);
    }
    for (const std::uint32_t pose : clique.frontals) clique_of_[pose] = index;
  }
  return made;
}

void PoseTree::refactor(const std::vector<std::uint32_t>& touched,
                        const std::vector<std::uint32_t>& newest, const TermSource& terms) {
  std::vector<std::int32_t> orphans;
  std::vector<std::uint32_t> poses = detach(touched, orphans);
  std::erase_if(poses, [&](std::uint32_t pose) { return !terms.has_terms(pose); });
  for (std::uint32_t i = 0; i < poses.size(); ++i) local_[poses[i]] = i;
  const std::vector<std::uint32_t> inside = terms_inside(poses, terms);
  const std::vector<std::int32_t> made = build_cliques(poses, inside, orphans, newest, terms);

  // What hangs on several poses belongs to the clique that eliminates the first of them: the
  // deepest, which `made` holds last.
  std::vector<std::int32_t> depth(cliques_.size(), kNone);
  for (std::size_t i = 0; i < made.size(); ++i) {
    depth[static_cast<std::size_t>(made[i])] = static_cast<std::int32_t>(i);
  }
  const auto deepest = [&](std::span<const std::uint32_t> members) {
    std::int32_t found = 0;
    for (const std::uint32_t pose : members) {
      found = std::max(found, depth[static_cast<std::size_t>(clique_of_[pose])]);
    }
    return static_cast<std::size_t>(found);
  };
  std::vector<std::vector<std::uint32_t>> own(made.size());
  for (const std::uint32_t term : inside) own[deepest(terms.poses_of(term))].push_back(term);
  for (const std::int32_t orphan : orphans) {
    at(orphan).parent = kNone;
    if (at(orphan).separator.empty()) continue;
    const std::int32_t parent = made[deepest(at(orphan).separator)];
    at(orphan).parent = parent;
    at(parent).children.push_back(orphan);
  }
  for (const std::uint32_t pose : poses) local_[pose] = kOutside;

  last_cost_ = 0;
  last_poses_ = poses.size();
  last_undetermined_ = 0;
  for (const std::int32_t orphan : orphans) restore_contribution(orphan, terms);
  for (std::size_t i = made.size(); i-- > 0;) factor(made[i], own[i], terms);
  for (const std::int32_t orphan : orphans) settle(orphan);
}

// Terms that have one of the clique's frontals and nothing that is eliminated below it.
std::vector<std::uint32_t> PoseTree::own_terms(const Clique& clique,
                                               const TermSource& terms) const {
  std::vector<std::uint32_t> members = clique.frontals;
  members.insert(members.end(), clique.separator.begin(), clique.separator.end());
  std::sort(members.begin(), members.end());
  std::vector<std::uint32_t> own;
  for (const std::uint32_t pose : clique.frontals) {
    for (const std::uint32_t term : terms.terms_of(pose)) {
      const auto poses = terms.poses_of(term);
      if (std::all_of(poses.begin(), poses.end(), [&](std::uint32_t one) {
            return std::binary_search(members.begin(), members.end(), one);
          })) {
        own.push_back(term);
      }
    }
  }
  sort_unique(own);
  return own;
}

// The clique's terms and all below are what they were when it was factored.
void PoseTree::restore_contribution(std::int32_t index, const TermSource& terms) {
  if (at(index).contribution.cols() == at(index).separator_rows()) return;
  for (const std::int32_t child : at(index).children) restore_contribution(child, terms);
  const bool fresh = at(index).fresh;
  factor(index, own_terms(at(index), terms), terms);
  at(index).fresh = fresh;
  if (at(index).settled) forget_contributions(at(index));
}

// What is below a clique that was left as it is will not be factored soon.
void PoseTree::settle(std::int32_t index) {
  if (at(index).settled) return;
  at(index).settled = true;
  forget_contributions(at(index));
  for (const std::int32_t child : at(index).children) settle(child);
}

// Of its children.
void PoseTree::forget_contributions(const Clique& clique) {
  for (const std::int32_t child : clique.children) {
    if ((at(child).height + 1) % options_.levels_kept != 0) at(child).contribution.resize(0, 0);
  }
}

void PoseTree::add_contribution(const Clique& child, Front& front) const {
  const std::size_t count = child.separator.size();
  const Eigen::Index rows = child.separator_rows();
  Eigen::Index column = 0;
  for (std::size_t j = 0; j < count; ++j) {
    const std::uint32_t slot_j = front.slot(child.separator[j]);
    const Eigen::Index width = size(child.separator[j]);
    Eigen::Index row = column;
    for (std::size_t i = j; i < count; ++i) {
      const Eigen::Index height = size(child.separator[i]);
      const std::uint32_t slot_i = front.slot(child.separator[i]);
      if (height == 6 && width == 6) {
        front.add(slot_i, slot_j, child.contribution.block<6, 6>(row, column));
      } else {
        front.add(slot_i, slot_j, child.contribution.block(row, column, height, width));
      }
      row += height;
    }
    front.add_gradient(slot_j, child.contribution.row(rows).segment(column, width).transpose());
    front.add_scale(slot_j, child.scale.segment(column, width));
    column += width;
  }
}

void PoseTree::damp(const Clique& clique, Front& front) const {
  for (const std::uint32_t pose : clique.frontals) {
    if (damping_[pose] == 0) continue;
    const std::uint32_t slot = front.slot(pose);
    const Eigen::VectorXd weight =
        damping_[pose] * front.scale().segment(front.row(slot), size(pose));
    front.add(slot, slot, Eigen::MatrixXd(weight.asDiagonal()));
    front.add_gradient(slot, Eigen::VectorXd(-weight.cwiseProduct(delta_of(pose))));
  }
}

// The Cholesky factor of the frontals' block, in place.
void PoseTree::factor_frontals(Clique& clique, Front& front) {
  const Eigen::Index f = clique.factor.cols();
  auto block = clique.factor.topRows(f);
  const Eigen::LLT<Eigen::MatrixXd> llt(block);
  bool sound = llt.info() == Eigen::Success;
  for (Eigen::Index i = 0; sound && i < f; ++i) {
    const double root = llt.matrixLLT()(i, i);
    sound = root * root > kPivotRounding * unit_of(front, i);
  }
  if (sound) {
    block = llt.matrixL();
    return;
  }
  ++singular_;
  last_undetermined_ += factor_held(clique, front);
}

// The same, one column after the other: where a pivot is rounding, the direction's present delta
// counts as measured. Returns how many were.
std::size_t PoseTree::factor_held(Clique& clique, Front& front) const {
  const Eigen::Index f = clique.factor.cols();
  auto block = clique.factor.topRows(f);
  auto gradient = clique.factor.bottomRows<1>();
  Eigen::VectorXd present(f);
  Eigen::Index row = 0;
  for (const std::uint32_t pose : clique.frontals) {
    present.segment(row, size(pose)) = delta_of(pose);
    row += size(pose);
  }
  std::size_t held = 0;
  for (Eigen::Index j = 0; j < f; ++j) {
    const double size = unit_of(front, j);
    const double unit = size > 0 ? size : 1;
    if (!(block(j, j) > kPivotRounding * unit)) {
      const double weight = options_.hold * unit;
      block(j, j) = std::max(block(j, j), 0.0) + weight;
      gradient[j] -= weight * present[j];
      ++held;
    }
    const Eigen::Index rest = f - j - 1;
    block(j, j) = std::sqrt(block(j, j));
    auto column = block.col(j).tail(rest);
    column /= block(j, j);
    block.bottomRightCorner(rest, rest).selfadjointView<Eigen::Lower>().rankUpdate(column, -1);
    block.row(j).tail(rest).setZero();
  }
  return held;
}

void PoseTree::factor(std::int32_t index, const std::vector<std::uint32_t>& own,
                      const TermSource& terms) {
  Clique& clique = at(index);
  std::uint32_t slot = 0;
  std::vector<Eigen::Index> offsets;
  offsets.reserve(clique.frontals.size() + clique.separator.size() + 1);
  offsets.push_back(0);
  for (const auto* members : {&clique.frontals, &clique.separator}) {
    for (const std::uint32_t pose : *members) {
      slot_of_[pose] = slot++;
      offsets.push_back(offsets.back() + size(pose));
    }
  }
  const Eigen::Index f = offsets[clique.frontals.size()];
  const Eigen::Index s = offsets.back() - f;
  Front front(std::move(offsets), slot_of_);
  for (const std::uint32_t term : own) terms.assemble(term, front);
  for (const std::int32_t child : clique.children) add_contribution(at(child), front);
  damp(clique, front);
  clique.height = 0;
  for (const std::int32_t child : clique.children) {
    clique.height = std::max(clique.height, at(child).height + 1);
  }

  Eigen::MatrixXd& matrix = front.matrix();
  clique.factor = matrix.leftCols(f);
  clique.contribution = matrix.bottomRightCorner(s + 1, s);
  clique.scale = front.scale().tail(s);
  factor_frontals(clique, front);
  if (!clique.factor.topRows(f).diagonal().allFinite() || !clique.factor.row(f + s).allFinite()) {
    throw std::logic_error("PoseTree: a term is not finite");
  }
  auto below = clique.factor.bottomRows(s + 1);
  clique.factor.topRows(f)
      .triangularView<Eigen::Lower>()
      .transpose()
      .solveInPlace<Eigen::OnTheRight>(below);
  if (s > 0) {
    const auto separator = clique.factor.middleRows(f, s);
    clique.contribution.topRows(s).selfadjointView<Eigen::Lower>().rankUpdate(separator, -1);
    clique.contribution.row(s).noalias() -= clique.factor.row(f + s) * separator.transpose();
  }
  clique.fresh = true;
  last_cost_ += factor_cost(f, s);
}

// Whether a variable, solved in this clique from this row on, moved by more than is worth telling.
bool PoseTree::has_changed(const Clique& clique, std::uint32_t variable, Eigen::Index row,
                           double threshold) const {
  const Eigen::Map<const Eigen::VectorXd> sent(sent_.data() + offset_[variable], size(variable));
  if (is_pose_[variable] != 0) {
    return (delta_of(variable) - sent).lpNorm<Eigen::Infinity>() > threshold;
  }
  const Eigen::VectorXd way = delta_of(variable) - sent;
  const auto root = clique.factor.block(row, row, way.size(), way.size());
  const Eigen::VectorXd in_sigmas = root.triangularView<Eigen::Lower>().transpose() * way;
  return in_sigmas.norm() > options_.share;
}

void PoseTree::solve_clique(Clique& clique, double threshold, std::vector<std::uint32_t>& changed) {
  const Eigen::Index f = clique.factor.cols();
  const Eigen::Index s = clique.separator_rows();
  Eigen::VectorXd right = -clique.factor.row(f + s).transpose();
  if (s > 0) {
    Eigen::VectorXd separator(s);
    Eigen::Index row = 0;
    for (const std::uint32_t pose : clique.separator) {
      separator.segment(row, size(pose)) = delta_of(pose);
      row += size(pose);
    }
    right.noalias() -= clique.factor.middleRows(f, s).transpose() * separator;
  }
  // What is shared stays where it is until that is worth telling all others, and they are solved
  // for with it there: those in this clique, too, or the motion would reach everything by them.
  Eigen::Index rest = f;
  for (std::size_t i = clique.frontals.size(); i-- > 0 && is_shared(clique.frontals[i]);) {
    const std::uint32_t variable = clique.frontals[i];
    const Eigen::Index first = rest - size(variable);
    auto value = right.segment(first, rest - first);
    clique.factor.block(first, first, rest - first, rest - first)
        .triangularView<Eigen::Lower>()
        .transpose()
        .solveInPlace(value);
    const Eigen::VectorXd before = delta_of(variable);
    values(delta_, variable) = value;
    if (!has_changed(clique, variable, first, threshold)) value = before;
    values(delta_, variable) = before;
    right.head(first).noalias() -=
        clique.factor.block(first, 0, rest - first, first).transpose() * value;
    rest = first;
  }
  auto others = right.head(rest);
  clique.factor.topLeftCorner(rest, rest)
      .triangularView<Eigen::Lower>()
      .transpose()
      .solveInPlace(others);
  const bool finite = right.allFinite();
  Eigen::Index row = 0;
  for (const std::uint32_t pose : clique.frontals) {
    auto delta = values(delta_, pose);
    auto sent = values(sent_, pose);
    solved_variables_.push_back(pose);
    before_.insert(before_.end(), delta.begin(), delta.end());
    before_.insert(before_.end(), sent.begin(), sent.end());
    if (finite) delta = right.segment(row, size(pose));
    if (has_changed(clique, pose, row, threshold)) {
      sent = delta;
      moved_[pose] = 1;
      changed.push_back(pose);
    }
    row += size(pose);
  }
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

std::vector<std::int32_t> PoseTree::depths() const {
  std::vector<std::int32_t> depths(cliques_.size(), kNone);
  std::vector<std::int32_t> way;
  for (std::size_t i = 0; i < cliques_.size(); ++i) {
    if (cliques_[i].frontals.empty()) continue;
    auto clique = static_cast<std::int32_t>(i);
    for (; clique != kNone && depths[static_cast<std::size_t>(clique)] == kNone;
         clique = at(clique).parent) {
      way.push_back(clique);
    }
    std::int32_t depth = clique == kNone ? 0 : depths[static_cast<std::size_t>(clique)] + 1;
    for (; !way.empty(); way.pop_back()) depths[static_cast<std::size_t>(way.back())] = depth++;
  }
  return depths;
}

std::int32_t PoseTree::clique_of(std::span<const std::uint32_t> variables,
                                 const std::vector<std::int32_t>& depths) const {
  std::int32_t deepest = kNone;
  std::int32_t depth = kNone;
  for (const std::uint32_t variable : variables) {
    const std::int32_t clique = clique_of_[variable];
    if (clique == kNone) return kNone;
    if (depths[static_cast<std::size_t>(clique)] > depth) {
      depth = depths[static_cast<std::size_t>(clique)];
      deepest = clique;
    }
  }
  return deepest;
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
