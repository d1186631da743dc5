#include "backend/incremental/pose_tree.h"

#include <algorithm>
#include <limits>
#include <map>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "backend/incremental/elimination_order.h"

namespace hybrid_slam {

namespace {

constexpr std::uint32_t kOutside = std::numeric_limits<std::uint32_t>::max();

// A pivot below this part of what terms added to its diagonal is rounding: some thousand
// eliminations, one after another, each with the precision of a double.
constexpr double kRankTolerance = 1e-12;

void sort_unique(std::vector<std::uint32_t>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

// Multiplications of a partial Cholesky of f of f + s poses.
double factor_cost(std::size_t frontals, std::size_t separator) {
  const double f = 6.0 * static_cast<double>(frontals);
  const double s = 6.0 * static_cast<double>(separator);
  return f * f * f / 6 + f * f * s / 2 + f * s * s / 2;
}

}  // namespace

void PoseTree::resize(std::size_t poses) {
  if (poses <= clique_of_.size()) return;
  clique_of_.resize(poses, kNone);
  delta_.resize(poses, Vector6d::Zero());
  sent_.resize(poses, Vector6d::Zero());
  moved_.resize(poses, 0);
  damping_.resize(poses, 0);
  local_.resize(poses, kOutside);
  slot_of_.resize(poses, 0);
}

double PoseTree::cost_of(std::span<const std::uint32_t> poses, std::vector<char>& marked) const {
  marked.resize(std::max(marked.size(), cliques_.size()), 0);
  double cost = 0;
  for (const std::uint32_t pose : poses) {
    for (std::int32_t i = clique_of_[pose]; i != kNone; i = at(i).parent) {
      char& mark = marked[static_cast<std::size_t>(i)];
      if (mark != 0) break;
      mark = 1;
      cost += factor_cost(at(i).frontals.size(), at(i).separator.size());
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
      // Once: at the first of its poses.
      if (*std::min_element(members.begin(), members.end()) != pose) continue;
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

  const auto eliminated = eliminate(adjacency, last, options_.max_padding);
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
  std::erase_if(poses, [&](std::uint32_t pose) { return terms.terms_of(pose).empty(); });
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
  for (std::size_t i = made.size(); i-- > 0;) factor(made[i], own[i], terms);
}

void PoseTree::add_contribution(const Clique& child, Front& front) const {
  const auto count = static_cast<Eigen::Index>(child.separator.size());
  for (Eigen::Index j = 0; j < count; ++j) {
    const std::uint32_t slot_j = front.slot(child.separator[static_cast<std::size_t>(j)]);
    for (Eigen::Index i = j; i < count; ++i) {
      front.add(front.slot(child.separator[static_cast<std::size_t>(i)]), slot_j,
                child.contribution.block<6, 6>(6 * i, 6 * j));
    }
    front.add_gradient(slot_j, child.contribution.row(6 * count).segment<6>(6 * j).transpose());
    front.add_scale(slot_j, child.scale.segment<6>(6 * j));
  }
}

void PoseTree::damp(const Clique& clique, Front& front) const {
  for (const std::uint32_t pose : clique.frontals) {
    if (damping_[pose] == 0) continue;
    const std::uint32_t slot = front.slot(pose);
    const Vector6d weight = damping_[pose] * front.scale().segment<6>(6 * slot);
    front.add(slot, slot, Matrix6d(weight.asDiagonal()));
    front.add_gradient(slot, Vector6d(-weight.cwiseProduct(delta_[pose])));
  }
}

// The Cholesky factor of the frontals' block, in place.
void PoseTree::factor_frontals(Clique& clique, const Eigen::VectorXd& scale) {
  const auto f = static_cast<Eigen::Index>(6 * clique.frontals.size());
  auto block = clique.factor.topRows(f);
  const Eigen::VectorXd diagonal = block.diagonal();
  const Eigen::LLT<Eigen::MatrixXd> llt(block);
  const auto pivots = llt.matrixLLT().diagonal().array().square();
  const Eigen::VectorXd size = scale.cwiseMax(diagonal);
  if (llt.info() == Eigen::Success && (pivots > kRankTolerance * size.array()).all()) {
    block = llt.matrixL();
    return;
  }
  ++singular_;
  last_undetermined_ += factor_held(clique, size);
}

// The same, one column after the other: where a pivot is rounding, the direction's present delta
// counts as measured. Returns how many were.
std::size_t PoseTree::factor_held(Clique& clique, const Eigen::VectorXd& size) const {
  const auto f = static_cast<Eigen::Index>(6 * clique.frontals.size());
  auto block = clique.factor.topRows(f);
  auto gradient = clique.factor.bottomRows<1>();
  std::size_t held = 0;
  for (Eigen::Index j = 0; j < f; ++j) {
    const double unit = size[j] > 0 ? size[j] : 1;
    if (!(block(j, j) > kRankTolerance * unit)) {
      const double weight = options_.hold * unit;
      block(j, j) = std::max(block(j, j), 0.0) + weight;
      const std::uint32_t pose = clique.frontals[static_cast<std::size_t>(j / 6)];
      gradient[j] -= weight * delta_[pose][j % 6];
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
  for (const std::uint32_t pose : clique.frontals) slot_of_[pose] = slot++;
  for (const std::uint32_t pose : clique.separator) slot_of_[pose] = slot++;
  Front front(slot, slot_of_);
  for (const std::uint32_t term : own) terms.assemble(term, front);
  for (const std::int32_t child : clique.children) add_contribution(at(child), front);
  damp(clique, front);

  const auto f = static_cast<Eigen::Index>(6 * clique.frontals.size());
  const auto s = static_cast<Eigen::Index>(6 * clique.separator.size());
  Eigen::MatrixXd& matrix = front.matrix();
  clique.factor = matrix.leftCols(f);
  clique.contribution = matrix.bottomRightCorner(s + 1, s);
  clique.scale = front.scale().tail(s);
  factor_frontals(clique, front.scale().head(f));
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
  last_cost_ += factor_cost(clique.frontals.size(), clique.separator.size());
}

void PoseTree::solve_clique(Clique& clique, double threshold, std::vector<std::uint32_t>& changed) {
  const auto f = static_cast<Eigen::Index>(6 * clique.frontals.size());
  const auto s = static_cast<Eigen::Index>(6 * clique.separator.size());
  Eigen::VectorXd right = -clique.factor.row(f + s).transpose();
  if (s > 0) {
    Eigen::VectorXd separator(s);
    for (std::size_t i = 0; i < clique.separator.size(); ++i) {
      separator.segment<6>(static_cast<Eigen::Index>(6 * i)) = delta_[clique.separator[i]];
    }
    right.noalias() -= clique.factor.middleRows(f, s).transpose() * separator;
  }
  clique.factor.topRows(f).triangularView<Eigen::Lower>().transpose().solveInPlace(right);
  const bool finite = right.allFinite();
  for (std::size_t i = 0; i < clique.frontals.size(); ++i) {
    const std::uint32_t pose = clique.frontals[i];
    if (!finite) right.segment<6>(static_cast<Eigen::Index>(6 * i)) = delta_[pose];
    before_.push_back({pose, delta_[pose], sent_[pose]});
    delta_[pose] = right.segment<6>(static_cast<Eigen::Index>(6 * i));
    if ((delta_[pose] - sent_[pose]).lpNorm<Eigen::Infinity>() > threshold) {
      sent_[pose] = delta_[pose];
      moved_[pose] = 1;
      changed.push_back(pose);
    }
  }
  clique.fresh = false;
}

void PoseTree::solve(double threshold, std::vector<std::uint32_t>& changed) {
  const std::size_t first = changed.size();
  before_.clear();
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

void PoseTree::undo_solve() {
  for (const Before& before : before_) {
    delta_[before.pose] = before.delta;
    sent_[before.pose] = before.sent;
  }
  for (const std::int32_t index : solved_) at(index).fresh = true;
  before_.clear();
  solved_.clear();
}

// Forward and back substitution with the pose's unit vectors, which concern its clique and those
// above only. Values are kept by pose: every pose above is frontal in one clique of the path.
Matrix6d PoseTree::covariance(std::uint32_t pose) const {
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, 6>;
  std::vector<std::int32_t> path;
  for (std::int32_t i = clique_of_[pose]; i != kNone; i = at(i).parent) path.push_back(i);
  if (path.empty()) return Matrix6d::Zero();
  std::map<std::uint32_t, Matrix6d> value;
  const auto gather = [&](const std::vector<std::uint32_t>& poses) {
    Columns columns = Columns::Zero(static_cast<Eigen::Index>(6 * poses.size()), 6);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const auto found = value.find(poses[i]);
      if (found != value.end())
        columns.middleRows<6>(static_cast<Eigen::Index>(6 * i)) = found->second;
    }
    return columns;
  };
  const auto scatter = [&](const std::vector<std::uint32_t>& poses, const Columns& columns) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      value[poses[i]] = columns.middleRows<6>(static_cast<Eigen::Index>(6 * i));
    }
  };
  value[pose] = Matrix6d::Identity();
  const auto split = [](const Clique& clique) {
    return std::pair(static_cast<Eigen::Index>(6 * clique.frontals.size()),
                     static_cast<Eigen::Index>(6 * clique.separator.size()));
  };
  for (const std::int32_t i : path) {
    const Clique& clique = at(i);
    const auto [f, s] = split(clique);
    Columns solved = gather(clique.frontals);
    clique.factor.topRows(f).triangularView<Eigen::Lower>().solveInPlace(solved);
    scatter(clique.frontals, solved);
    if (s > 0) {
      scatter(clique.separator, gather(clique.separator) - clique.factor.middleRows(f, s) * solved);
    }
  }
  for (std::size_t k = path.size(); k-- > 0;) {
    const Clique& clique = at(path[k]);
    const auto [f, s] = split(clique);
    Columns right = gather(clique.frontals);
    if (s > 0) right -= clique.factor.middleRows(f, s).transpose() * gather(clique.separator);
    clique.factor.topRows(f).triangularView<Eigen::Lower>().transpose().solveInPlace(right);
    scatter(clique.frontals, right);
  }
  return value.at(pose);
}

}  // namespace hybrid_slam
