#include "backend/incremental/pose_tree.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "backend/incremental/elimination_order.h"

// The tree's shape: which cliques there are, and what each has to factor.

namespace hybrid_slam {

namespace {

constexpr std::uint32_t kOutside = std::numeric_limits<std::uint32_t>::max();

void sort_unique(std::vector<std::uint32_t>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
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
      cost += factor_cost(at(i).frontal_rows(), at(i).separator_rows());
    }
  }
  return cost;
}

bool PoseTree::mark_up_to(double& most, std::span<const std::uint32_t> poses,
                          std::vector<char>& marked) const {
  marked.resize(std::max(marked.size(), cliques_.size()), 0);
  std::vector<std::int32_t> way;
  double cost = 0;
  for (std::size_t k = 0; k < poses.size() && cost <= most; ++k) {
    for (std::int32_t i = clique_of_[poses[k]]; i != kNone && cost <= most; i = at(i).parent) {
      char& mark = marked[static_cast<std::size_t>(i)];
      if (mark != 0) break;
      mark = 1;
      way.push_back(i);
      cost += factor_cost(at(i).frontal_rows(), at(i).separator_rows());
    }
  }
  if (cost <= most) {
    most -= cost;
    return true;
  }
  for (const std::int32_t i : way) marked[static_cast<std::size_t>(i)] = 0;
  return false;
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

// Of the terms of which every pose is among these (local_ is set): the others belong to subtrees
// below. Those of the orphans come last.
PoseTree::Groups PoseTree::groups_inside(const std::vector<std::uint32_t>& poses,
                                         const std::vector<std::int32_t>& orphans,
                                         const TermSource& terms) {
  ++look_;
  std::vector<std::uint32_t> met;
  for (const std::uint32_t pose : poses) {
    for (const std::uint32_t term : terms.terms_of(pose)) {
      if (term >= looked_at_.size()) looked_at_.resize(term + 1, 0);
      if (std::exchange(looked_at_[term], look_) != look_) met.push_back(term);
    }
  }
  std::sort(met.begin(), met.end());
  Groups groups;
  const auto add = [&](std::span<const std::uint32_t> members) {
    for (const std::uint32_t pose : members) groups.members.push_back(local_[pose]);
    groups.first.push_back(groups.members.size());
  };
  for (std::size_t i = 0; i < met.size(); ++i) {
    terms.fetch_poses(met, i);
    const auto members = terms.poses_of(met[i]);
    if (std::all_of(members.begin(), members.end(),
                    [&](std::uint32_t member) { return local_[member] != kOutside; })) {
      groups.terms.push_back(met[i]);
      add(members);
    }
  }
  for (const std::int32_t orphan : orphans) add(at(orphan).separator);
  return groups;
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

// Which of so many poses share a term or a separator.
std::vector<std::vector<std::uint32_t>> PoseTree::adjacency_of(std::size_t poses,
                                                               const Groups& groups) {
  // Which groups each pose is in, one pose after the other.
  std::vector<std::size_t> first(poses + 1, 0);
  for (const std::uint32_t pose : groups.members) ++first[pose + 1];
  for (std::size_t i = 0; i < poses; ++i) first[i + 1] += first[i];
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  std::vector<std::uint32_t> groups_of(groups.members.size());
  for (std::size_t group = 0; group < groups.size(); ++group) {
    for (const std::uint32_t pose : groups.of(group)) {
      groups_of[next[pose]++] = static_cast<std::uint32_t>(group);
    }
  }
  std::vector<std::vector<std::uint32_t>> adjacency(poses);
  std::vector<std::uint32_t> neighbour_of(poses, kOutside);  // the last of which it is one
  for (std::uint32_t i = 0; i < poses; ++i) {
    neighbour_of[i] = i;
    for (std::size_t k = first[i]; k < first[i + 1]; ++k) {
      for (const std::uint32_t pose : groups.of(groups_of[k])) {
        if (std::exchange(neighbour_of[pose], i) != i) adjacency[i].push_back(pose);
      }
    }
    std::sort(adjacency[i].begin(), adjacency[i].end());
  }
  return adjacency;
}

std::vector<std::int32_t> PoseTree::build_cliques(const std::vector<std::uint32_t>& poses,
                                                  const Groups& groups,
                                                  const std::vector<std::uint32_t>& newest) {
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

  const auto eliminated =
      eliminate(adjacency_of(poses.size(), groups), last, options_.max_padding, sizes);
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

// Hangs the orphans on the cliques that were made, and returns the terms of each of these. What
// has several poses belongs to the clique that eliminates the first of them: the deepest, which
// `made` holds last.
std::vector<std::vector<std::uint32_t>> PoseTree::attach(const std::vector<std::uint32_t>& poses,
                                                         const std::vector<std::int32_t>& made,
                                                         const Groups& groups,
                                                         const std::vector<std::int32_t>& orphans) {
  std::vector<std::int32_t> depth(cliques_.size(), kNone);
  for (std::size_t i = 0; i < made.size(); ++i) {
    depth[static_cast<std::size_t>(made[i])] = static_cast<std::int32_t>(i);
  }
  const auto deepest = [&](std::size_t group) {
    std::int32_t found = 0;
    for (const std::uint32_t i : groups.of(group)) {
      found = std::max(found, depth[static_cast<std::size_t>(clique_of_[poses[i]])]);
    }
    return static_cast<std::size_t>(found);
  };
  const std::size_t terms = groups.terms.size();
  std::vector<std::vector<std::uint32_t>> own(made.size());
  for (std::size_t i = 0; i < terms; ++i) own[deepest(i)].push_back(groups.terms[i]);
  for (std::size_t i = 0; i < orphans.size(); ++i) {
    const std::int32_t orphan = orphans[i];
    at(orphan).parent = kNone;
    if (at(orphan).separator.empty()) continue;
    const std::int32_t parent = made[deepest(terms + i)];
    at(orphan).parent = parent;
    at(parent).children.push_back(orphan);
  }
  return own;
}

void PoseTree::refactor(const std::vector<std::uint32_t>& touched,
                        const std::vector<std::uint32_t>& newest, const TermSource& terms) {
  std::vector<std::int32_t> orphans;
  std::vector<std::uint32_t> poses = detach(touched, orphans);
  std::erase_if(poses, [&](std::uint32_t pose) { return !terms.has_terms(pose); });
  for (std::uint32_t i = 0; i < poses.size(); ++i) local_[poses[i]] = i;
  const Groups groups = groups_inside(poses, orphans, terms);
  const std::vector<std::int32_t> made = build_cliques(poses, groups, newest);

  const auto own = attach(poses, made, groups, orphans);
  for (const std::uint32_t pose : poses) local_[pose] = kOutside;

  last_cost_ = 0;
  last_poses_ = poses.size();
  last_undetermined_ = 0;
  for (const std::int32_t orphan : orphans) restore_contribution(orphan, terms);
  for (std::size_t i = made.size(); i-- > 0;) factor(made[i], own[i], terms);
  for (const std::int32_t orphan : orphans) settle(orphan);
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

}  // namespace hybrid_slam
